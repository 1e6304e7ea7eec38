"use strict";
// The slider of quantities and channels, the 3D view's colours, the key figures, and the spectrum of what is pointed at.
// The data come from lidarspectra/mapping/report/room_view.py; words from users are set as text, never as HTML.

/* global RoomPicture, RoomLight, RoomChart, LampPanel */
(() => {
  const FIRST_BAND_NM = 560; // near the eye's best
  const BURIED_COLOR = [0.54, 0.56, 0.59];
  const NARROWEST = 0.5; // a scale starts at 0 where the lowest value is below this share of the highest
  const KELVIN = { key: "cct", words: "colour temperature", unit: "K" };

  const { html, digits, signed } = RoomChart;
  const element = (name) => document.getElementById(`room-${name}`);
  const room = RoomPicture.unpacked(JSON.parse(element("data").textContent));
  const { bands, points, materials, surfaces, lamps } = room;
  const count = points.numbers.length;
  const light = room.light === null ? null : new RoomLight(room.light, bands.length);
  const nearest = (from, to) => (Math.abs(from - FIRST_BAND_NM) <= Math.abs(to - FIRST_BAND_NM) ? from : to);
  const items = [...quantities(), ...bands.map((_, band) => ({ band }))]; // of the slider
  const state = {
    item: items[0].band === undefined ? 0 : bands.indexOf(bands.reduce(nearest)),
    surfaces: surfaces === null ? "none" : "scanned",
    point: 0, // selected
    over: null, // pointed at, as RoomPicture.pick gives it
  };
  const traced = new Map(); // what the page knew of the light as traced, for scales and key figures
  let panel = null;

  // ---- numbers and colours

  /** The slider's quantities, each with its value at a point. */
  function quantities() {
    if (light === null || light.responses === 0) {
      if (points.illuminance === null) return [];
      return [{ key: "illuminance_lx", words: "illuminance", unit: "lx", at: (point) => points.illuminance[point] }];
    }
    const known = light.data.responses.map((response, row) => ({ ...response, at: (point) => light.quantity(row, point) }));
    known.splice(3, 0, { ...KELVIN, at: (point) => light.colorTemperature(point) }); // before the cells
    return known;
  }

  const isChanged = () => light !== null && light.changed;
  const irradiance = (point, band) => (isChanged() ? light : points).irradiance[point * bands.length + band];
  const standardError = (point, band) => points.error[point * bands.length + band];
  const item = () => items[state.item];
  /** The channel shown, or the one nearest the eye's best while a quantity is. */
  const band = () => item().band ?? bands.indexOf(bands.reduce(nearest));
  const value = (point, { at, band: channel } = item()) => (channel === undefined ? at(point) : points.factor * irradiance(point, channel));
  const unit = ({ unit: own } = item()) => own ?? points.unit;
  const inUnit = (number, places = 3) => signed((number * points.factor).toPrecision(places));
  const channelName = (channel) => `${digits(bands[channel])} nm`;
  const itemName = (of = item()) => (of.band === undefined ? of.words : channelName(of.band));
  const kept = Array.from({ length: count }, (_, point) => point).filter((point) => !points.buried[point]);
  const counted = kept.length ? kept : Array.from({ length: count }, (_, point) => point);

  /** Lowest, highest and mean of an item over the points that are not buried; null where it has no value. */
  function range(of) {
    const all = counted.map((point) => value(point, of)).filter(Number.isFinite);
    if (all.length === 0) return null;
    const [low, high] = [all.reduce((a, b) => Math.min(a, b)), all.reduce((a, b) => Math.max(a, b))];
    return { low, high, mean: all.reduce((sum, each) => sum + each, 0) / all.length };
  }

  /** Ends of the scale: those of the light as traced, widened where the lamps now go beyond. */
  function limits() {
    if (item().band !== undefined && element("shared").checked) return [0, points.factor * points.highest];
    const both = [traced.get(item()), isChanged() ? range(item()) : null].filter((each) => each !== null);
    if (both.length === 0) return [0, 1];
    const [low, high] = [Math.min(...both.map((each) => each.low)), Math.max(...both.map((each) => each.high))];
    if (high <= 0) return [0, 1];
    return [low < NARROWEST * high ? 0 : low - 0.05 * (high - low || high), high];
  }

  const srgb = (linear) => (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055); // IEC 61966-2-1
  const fromHex = (hex) => [1, 3, 5].map((start) => parseInt(hex.slice(start, start + 2), 16) / 255);
  const scale = room.colors.map(fromHex);

  /** A function from point to colour. */
  function pointColors() {
    const [low, high] = limits();
    return (point) => {
      const shown = value(point);
      if (points.buried[point] || !Number.isFinite(shown)) return BURIED_COLOR;
      const place = Math.round(((shown - low) / (high - low)) * (scale.length - 1));
      return scale[Math.min(scale.length - 1, Math.max(0, place))];
    };
  }

  /** A function from face to colour, or null where surfaces are hidden. */
  function faceColors() {
    if (state.surfaces === "none") return null;
    if (state.surfaces === "scanned") {
      return (face) => [0, 1, 2].map((part) => surfaces.scanned[3 * face + part] / 255);
    }
    const ofMaterial = materials.map((material) =>
      state.surfaces === "reflectance" ? Array(3).fill(srgb(material.reflectance[band()])) : fromHex(material[state.surfaces]),
    );
    return (face) => ofMaterial[surfaces.materials[face]];
  }

  // ---- words

  function showPoint(point) {
    const [x, y, z] = [...points.places.subarray(3 * point, 3 * point + 3)].map((metres) => signed(metres.toFixed(2)));
    const error = isChanged() ? "" : ` ± ${inUnit(standardError(point, band()), 2)}`; // known of the traced light alone
    const lines = [
      html("strong", `Point ${points.numbers[point]}`),
      html("span", `x ${x}, y ${y}, z ${z} m`),
      ...items
        .filter((each) => each.band === undefined)
        .map((each) => html("span", `${each.words}: ${Number.isFinite(value(point, each)) ? digits(value(point, each)) : "–"} ${each.unit}`)),
      html("span", `${channelName(band())}: ${inUnit(irradiance(point, band()))}${error} ${points.unit}`),
    ];
    if (points.buried[point]) lines.push(html("span", "buried in furniture or a wall: its values are meaningless"));
    element("reading").replaceChildren(...lines);
    const values = bands.map((_, each) => points.factor * irradiance(point, each));
    const before = isChanged() ? bands.map((_, each) => points.factor * points.irradiance[point * bands.length + each]) : null;
    const errors = isChanged() ? null : bands.map((_, each) => points.factor * standardError(point, each));
    const highest = Math.max(...values.map((each, at) => Math.max(each + RoomChart.ERROR_BARS * (errors?.[at] ?? 0), before?.[at] ?? 0))) || 1;
    const look = { highest, unit: points.unit, label: "irradiance", here: band(), before };
    element("chart").replaceChildren(RoomChart.spectrum(bands, values, errors, look));
  }

  function showMaterial({ name, category, area, reflectance, deviation }) {
    element("reading").replaceChildren(
      html("strong", name),
      html("span", `${category}; ${digits(area)} m² of it`),
      html("span", `${channelName(band())}: reflectance ${reflectance[band()].toFixed(2)}`),
    );
    const look = { highest: 1, unit: "1", label: "reflectance", here: band() };
    element("chart").replaceChildren(RoomChart.spectrum(bands, reflectance, deviation, look));
  }

  function showLamp(number) {
    const now = light?.lamps.find(({ drawn }) => drawn === number)?.now;
    const lines = now === undefined ? [] : [now.on ? `dimmed to ${Math.round(100 * now.dim)} %` : "off", `${digits(now.lumens)} lm at full power`];
    element("reading").replaceChildren(html("strong", lamps[number].name), ...["lamp", ...lines].map((words) => html("span", words)));
    element("chart").replaceChildren();
  }

  function showReading() {
    if (state.over?.face !== undefined) showMaterial(materials[surfaces.materials[state.over.face]]);
    else if (state.over?.lamp !== undefined) showLamp(state.over.lamp);
    else showPoint(state.over?.point ?? state.point);
  }

  function showLegend() {
    const parts = RoomChart.legendBar(`${itemName()} [${unit()}]`, room.colors, ...limits().map(digits));
    if (state.surfaces === "reflectance") {
      const greys = [0, 0.1, 0.25, 0.5, 0.75, 1].map((linear) => `rgb(${Array(3).fill(Math.round(255 * srgb(linear)))}) ${100 * linear}%`);
      parts.push(...RoomChart.legendBar(`reflectance at ${channelName(band())}`, greys, "0", "1"));
    }
    if (state.surfaces === "code") {
      const kinds = html("ul", "", "room-kinds");
      for (const [kind, color] of new Map(materials.map((material) => [material.kind, material.code]))) {
        const [item, swatch] = [html("li", kind), html("span", "", "swatch")];
        swatch.style.background = color;
        item.prepend(swatch);
        kinds.append(item);
      }
      parts.push(kinds);
    }
    element("legend").replaceChildren(...parts);
  }

  // ---- key figures

  /** A key figure now: that of the run times how the page's own changed, since the page may have fewer points. */
  function changedFact({ fact, key, number, unit: own }) {
    const of = items.find((each) => each.key === key);
    const figure = ({ low, mean }) => (fact === "mean" ? mean : low / mean);
    const share = of === undefined ? NaN : figure(range(of)) / figure(traced.get(of));
    if (!Number.isFinite(share)) return "–";
    return fact === "mean" ? `${digits(Number(number) * share)} ${own}` : (Number(number) * share).toFixed(2);
  }

  /** The numbers above the picture under the lamps as they are now, each with what it was. */
  function showFacts() {
    for (const node of document.querySelectorAll("[data-fact]")) {
      const [shown, remark] = [node.querySelector(".value"), node.querySelector("small")];
      node.dataset.traced ??= shown.textContent;
      node.dataset.remark ??= remark.textContent;
      shown.textContent = isChanged() ? changedFact(node.dataset) : node.dataset.traced;
      remark.textContent = isChanged() ? `as traced ${node.dataset.traced}` : node.dataset.remark;
    }
    const lux = items.find(({ key }) => key === "illuminance_lx");
    if (lux === undefined) return;
    const mean = (all) => `${digits(all.mean)} lx`;
    document.getElementById("lamps-now").textContent = isChanged()
      ? `mean ${mean(traced.get(lux))} → ${mean(range(lux))}`
      : `mean ${mean(traced.get(lux))}`;
  }

  // ---- what the user does

  const picture = startPicture();

  function startPicture() {
    try {
      return new RoomPicture(element("canvas"), room);
    } catch (cause) {
      // three.js throws where there is no WebGL; the chart and its controls work without it.
      element("canvas").hidden = true;
      element("message").hidden = false;
      element("message").textContent =
        `This browser cannot show 3D here (${cause.message}). Choose a point by its number for its spectrum; the maps below need no 3D.`;
      return null;
    }
  }

  function repaint() {
    element("shown-name").textContent = itemName();
    element("shown").setAttribute("aria-valuetext", `${itemName()} [${unit()}]`);
    for (const { drawn, now } of light?.lamps ?? []) if (drawn !== null) picture?.shine(drawn, now.on ? now.dim : 0);
    picture?.paint(pointColors(), faceColors(), element("sheet").checked);
    showLegend();
    showFacts();
    showReading();
  }

  function select(point) {
    state.point = point;
    element("point").value = points.numbers[point];
    picture?.select(point);
    showReading();
  }

  for (const each of items) traced.set(each, range(each));
  element("shown").max = items.length - 1;
  element("shown").value = state.item;
  element("shown").addEventListener("input", (event) => {
    state.item = Number(event.target.value);
    repaint();
  });
  element("surfaces").value = state.surfaces;
  element("surfaces").querySelector("[value=code]").textContent = `by ${room.kind}`;
  element("surfaces").disabled = surfaces === null;
  element("surfaces").addEventListener("change", (event) => {
    state.surfaces = event.target.value;
    repaint();
  });
  element("sheet").addEventListener("change", repaint);
  element("shared").addEventListener("change", repaint);
  element("reset").addEventListener("click", () => picture?.reset());
  element("point").max = points.numbers[count - 1];
  element("point-count").textContent = `of ${points.count}`;
  element("point").addEventListener("input", (event) => {
    // Of a thinned map the next point that is here.
    const wanted = Number(event.target.value);
    const found = points.numbers.findIndex((number) => number >= wanted);
    if (wanted >= 1 && found >= 0) select(found);
  });

  if (picture !== null) {
    const { canvas } = picture;
    let pressed = null;
    const near = (event) => pressed !== null && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 4;
    canvas.addEventListener("pointerdown", (event) => (pressed = [event.clientX, event.clientY]));
    canvas.addEventListener("pointerup", (event) => {
      const found = near(event) ? picture.pick(event) : null;
      if (found?.point !== undefined) select(found.point);
      if (found?.lamp !== undefined) panel?.toggle(light.lamps.findIndex(({ drawn }) => drawn === found.lamp));
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons !== 0) return; // turning
      state.over = picture.pick(event);
      canvas.style.cursor = state.over?.point === undefined && state.over?.lamp === undefined ? "" : "pointer";
      showReading();
    });
    canvas.addEventListener("pointerleave", () => {
      state.over = null;
      showReading();
    });
  }

  select(0);
  if (light === null) repaint();
  else panel = new LampPanel(light, room.run, repaint); // which paints the light of the page's address
})();
