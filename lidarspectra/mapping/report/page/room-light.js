"use strict";
// The light at the points under changed lamps, as `lidarspectra relight` computes it: see lamp_light.py, whose data this is.

class RoomLight {
  static MAX_DUV = 0.05; // farther from the locus a colour temperature has no meaning (CIE 15:2018, 9.5)

  /**
   * @param {object} data Unpacked, of lamp_light.py.
   * @param {number} bands How many channels.
   */
  constructor(data, bands) {
    this.data = data;
    this.bands = bands;
    this.slots = data.channel.length;
    this.points = data.codes.length / (data.lamps.length * this.slots);
    this.responses = data.responses.length;
    this.rows = this.responses > 0 ? this.responses + 3 : 0; // and X, Y, Z
    this.lamps = data.lamps.map((lamp) => ({ ...lamp, now: RoomLight.#asTraced(lamp), parts: null }));
    this.irradiance = new Float64Array(this.points * bands);
    this.values = new Float64Array(this.points * this.rows);
    this.update();
  }

  static #asTraced({ own, lumens }) {
    return { on: true, dim: 1, spectrum: own, lumens };
  }

  /** Whether any lamp is otherwise than traced. */
  get changed() {
    return this.lamps.some((lamp) => this.isChanged(lamp));
  }

  isChanged({ now, own, lumens }) {
    return !now.on || now.dim !== 1 || now.spectrum !== own || now.lumens !== lumens;
  }

  /** Change a lamp: {on, dim [0-1], spectrum (its number), lumens [lm]}; what is not named stays. */
  set(lamp, change) {
    const { now } = this.lamps[lamp];
    if (change.spectrum !== undefined && change.spectrum !== now.spectrum) this.lamps[lamp].parts = null;
    Object.assign(now, change);
    this.update();
  }

  /** All lamps as they were traced. */
  reset() {
    for (const lamp of this.lamps) {
      if (lamp.now.spectrum !== lamp.own) lamp.parts = null;
      lamp.now = RoomLight.#asTraced(lamp);
    }
    this.update();
  }

  /** What a lamp's unit light is multiplied by: lumens for a spectrum of one lumen, else 1. */
  factor({ now, lumens }) {
    return (now.on ? now.dim : 0) * (lumens > 0 ? now.lumens : 1);
  }

  /** Add up the lamps. */
  update() {
    this.irradiance.fill(0);
    this.values.fill(0);
    for (const lamp of this.lamps) {
      const factor = this.factor(lamp);
      if (factor === 0) continue;
      lamp.parts ??= this.#parts(lamp);
      const { irradiance, values } = lamp.parts;
      for (let at = 0; at < irradiance.length; at += 1) this.irradiance[at] += factor * irradiance[at];
      for (let at = 0; at < values.length; at += 1) this.values[at] += factor * values[at];
    }
  }

  /** A lamp's irradiance in every channel, and its quantities, at every point, for a factor of 1. */
  #parts(lamp) {
    const { bands, slots, points, rows } = this;
    const { codes, channel, fold, flux, weights } = this.data;
    const [irradiance, values] = [new Float64Array(points * bands), new Float64Array(points * rows)];
    const [spectrum, first] = [lamp.now.spectrum, this.lamps.indexOf(lamp) * points * slots];
    const coefficient = new Float64Array(bands);
    for (let point = 0; point < points; point += 1) {
      coefficient.fill(0);
      for (let slot = 0; slot < slots; slot += 1) {
        const code = codes[first + point * slots + slot];
        if (code > 0) coefficient[channel[slot]] += fold[spectrum * slots + slot] * lamp.lowest * Math.exp((code - 1) * lamp.step);
      }
      for (let band = 0; band < bands; band += 1) {
        irradiance[point * bands + band] = coefficient[band] * flux[spectrum * bands + band];
        for (let row = 0; row < rows; row += 1) {
          values[point * rows + row] += coefficient[band] * weights[(spectrum * rows + row) * bands + band];
        }
      }
    }
    return { irradiance, values };
  }

  /** A quantity by its number among the data's `responses`. */
  quantity(row, point) {
    return this.values[point * this.rows + row];
  }

  /** Correlated colour temperature [K], Ohno 2014's triangular solution; NaN where it has no meaning. */
  colorTemperature(point) {
    const at = point * this.rows + this.responses;
    const [x, y, z] = this.values.subarray(at, at + 3);
    const base = x + 15 * y + 3 * z;
    if (!(base > 0)) return NaN;
    const [u, v] = [(4 * x) / base, (6 * y) / base];
    const [kelvin, us, vs] = this.data.locus;
    const distance = (index) => Math.hypot(us[index] - u, vs[index] - v);
    let nearest = 0;
    for (let index = 1; index < kelvin.length; index += 1) if (distance(index) < distance(nearest)) nearest = index;
    if (nearest === 0 || nearest === kelvin.length - 1 || distance(nearest) > RoomLight.MAX_DUV) return NaN;
    const [before, after] = [nearest - 1, nearest + 1];
    const chord = Math.hypot(us[after] - us[before], vs[after] - vs[before]);
    const along = (distance(before) ** 2 - distance(after) ** 2 + chord ** 2) / (2 * chord);
    return kelvin[before] + ((kelvin[after] - kelvin[before]) * along) / chord;
  }

  // ---- a scenario in words

  /** The changed lamps as pairs of option and value, in the command's order. */
  changes() {
    const pairs = [];
    for (const lamp of this.lamps) {
      if (!this.isChanged(lamp)) continue;
      const { on, dim, spectrum, lumens } = lamp.now;
      pairs.push(["lamp", lamp.name]);
      if (spectrum !== lamp.own) pairs.push(["spectrum", this.data.spectra[spectrum].name]);
      // A spectrum of the databases may be absolute: its lumens are always said.
      if (spectrum !== lamp.own || lumens !== lamp.lumens) pairs.push(["lumens", String(Number(lumens.toPrecision(6)))]);
      if (!on || dim !== 1) pairs.push(["dim", on ? String(Number(dim.toPrecision(4))) : "0"]);
    }
    return pairs;
  }

  /** Set the lamps by such pairs; what does not fit this room is left out, and named. */
  apply(pairs) {
    this.reset();
    const wrong = [];
    let lamp = null;
    for (const [option, value] of pairs) {
      if (option === "lamp") {
        lamp = this.lamps.find((each) => each.name === value) ?? null;
        if (lamp === null) wrong.push(`lamp '${value}'`);
      } else if (lamp !== null && !this.#applyTo(lamp, option, value)) wrong.push(`${option} '${value}' of '${lamp.name}'`);
    }
    this.update();
    return wrong;
  }

  #applyTo(lamp, option, value) {
    if (option === "spectrum") {
      const found = lamp.choices.find((index) => this.data.spectra[index].name === value);
      if (found === undefined) return false;
      lamp.now.spectrum = found;
      lamp.parts = null;
      return true;
    }
    const number = Number(value);
    if (value === "" || !(number >= 0) || number === Infinity) return false;
    if (option === "lumens" && lamp.lumens > 0) lamp.now.lumens = number;
    else if (option === "dim" && number <= 1) Object.assign(lamp.now, number === 0 ? { on: false } : { dim: number });
    else return false;
    return true;
  }

  /** A word as shells take it: bare, in double quotes, or, where it has what these expand, in single ones. */
  static quoted(word) {
    if (/^[\w.,:/@%+=-]+$/.test(word)) return word;
    return /["$`\\!]/.test(word) ? `'${word.replaceAll("'", "'\\''")}'` : `"${word}"`;
  }

  /** The command that makes the same map. */
  command(run, name) {
    const words = this.changes().flatMap(([option, value]) => [`--${option}`, RoomLight.quoted(value)]);
    return ["lidarspectra", "relight", RoomLight.quoted(run), ...(name ? ["--name", RoomLight.quoted(name)] : []), ...words].join(" ");
  }
}
