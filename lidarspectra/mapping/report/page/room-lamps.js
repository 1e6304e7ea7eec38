"use strict";
// Controls of the lamps: a switch, a dimmer, a spectrum and the lumens of each; the scenario as a link and as a command.

/* global RoomChart */
class LampPanel {
  static OWN = "as it is";

  /**
   * @param {RoomLight} light
   * @param {string} run Name of the run's folder, for the command.
   * @param {() => void} onChange Called after every change.
   */
  constructor(light, run, onChange) {
    [this.light, this.run, this.onChange] = [light, run, onChange];
    this.controls = light.lamps.map((lamp, index) => this.#controls(lamp, index));
    this.#element("list").replaceChildren(...this.controls.map(({ box }) => box));
    this.#element("panel").hidden = false;
    this.#element("reset").addEventListener("click", () => this.#all(() => light.reset()));
    this.#element("off").addEventListener("click", () =>
      this.#all(() => light.lamps.forEach((_, index) => light.set(index, { on: false }))),
    );
    this.#element("name").addEventListener("input", () => this.#tell());
    for (const what of ["command", "link"]) this.#element(`copy-${what}`).addEventListener("click", () => this.#copy(what));
    window.addEventListener("hashchange", () => this.read());
    this.read();
  }

  #element(name) {
    return document.getElementById(`lamps-${name}`);
  }

  /** One lamp's box, with its inputs by name. */
  #controls({ name, lumens, own, choices }, index) {
    const { html } = RoomChart;
    const [box, title] = [html("fieldset", "", "lamp"), html("legend", name)];
    title.title = name;
    const input = (type, words, options) => {
      const node = Object.assign(document.createElement("input"), { type, ...options });
      const label = html("label", words);
      label.append(node);
      return { node, label };
    };
    const power = input("checkbox", "on", { checked: true });
    power.node.setAttribute("role", "switch");
    const dim = input("range", "dimmed to", { min: "0", max: "100", step: "1", value: "100" });
    const shown = html("output", "100 %");
    dim.label.append(shown);
    const flux = input("number", "lumens", { min: "0", step: "any", value: String(Math.round(lumens)) });
    flux.node.disabled = lumens <= 0;
    const spectrum = { node: html("select"), label: html("label", "spectrum") };
    spectrum.label.append(spectrum.node);
    this.#fillSpectra(spectrum.node, own, choices);
    box.append(title, power.label, dim.label, spectrum.label, flux.label);
    const change = (values) => {
      this.light.set(index, values);
      this.#changed();
    };
    power.node.addEventListener("change", () => change({ on: power.node.checked }));
    dim.node.addEventListener("input", () => change({ on: true, dim: Number(dim.node.value) / 100 }));
    spectrum.node.addEventListener("change", () => change({ spectrum: Number(spectrum.node.value) }));
    flux.node.addEventListener("change", () => {
      const wanted = flux.node.valueAsNumber;
      change({ lumens: wanted >= 0 ? wanted : lumens }); // an empty field: as traced
    });
    return { box, power: power.node, dim: dim.node, shown, spectrum: spectrum.node, flux: flux.node };
  }

  #fillSpectra(select, own, choices) {
    const { spectra } = this.light.data;
    const option = (index, words) => Object.assign(RoomChart.html("option", words), { value: String(index) });
    select.append(option(own, spectra[own].name ? `${spectra[own].name} (${LampPanel.OWN})` : LampPanel.OWN));
    for (const [group, indices] of this.#grouped(choices)) {
      const node = Object.assign(document.createElement("optgroup"), { label: group });
      node.append(...indices.map((index) => option(index, spectra[index].name)));
      select.append(node);
    }
    select.disabled = choices.length === 0;
  }

  #grouped(choices) {
    const groups = new Map();
    for (const index of choices) {
      const { group } = this.light.data.spectra[index];
      groups.set(group, [...(groups.get(group) ?? []), index]);
    }
    return groups;
  }

  #all(change) {
    change();
    this.#changed();
  }

  /** Switch a lamp over, as a press on it in the picture does. */
  toggle(index) {
    this.light.set(index, { on: !this.light.lamps[index].now.on });
    this.#changed();
  }

  #changed() {
    this.show();
    this.#tell();
    this.onChange();
  }

  /** Show the lamps' state in the controls. */
  show() {
    this.light.lamps.forEach(({ now }, index) => {
      const { box, power, dim, shown, spectrum, flux } = this.controls[index];
      power.checked = now.on;
      dim.value = String(Math.round(100 * now.dim));
      shown.textContent = `${Math.round(100 * now.dim)} %`;
      dim.setAttribute("aria-valuetext", shown.textContent);
      spectrum.value = String(now.spectrum);
      if (document.activeElement !== flux) flux.value = String(Number(now.lumens.toPrecision(5)));
      box.classList.toggle("off", !now.on);
    });
  }

  /** The link's fragment: what the command says, as lamp=…&dim=…; empty where nothing is changed. */
  fragment() {
    const pairs = this.light.changes();
    const name = this.#element("name").value.trim();
    return pairs.length ? new URLSearchParams([...(name ? [["name", name]] : []), ...pairs]).toString() : "";
  }

  /** Keep the scenario in the page's address, and say its command. */
  #tell() {
    const { changed } = this.light;
    const address = new URL(window.location.href);
    address.hash = this.fragment();
    if (changed || new URLSearchParams(window.location.hash.slice(1)).has("lamp")) {
      window.history.replaceState(null, "", address.hash || `${address.pathname}${address.search}`);
    }
    this.#element("kept").hidden = !changed;
    this.#element("reset").disabled = !changed;
    if (!changed) return;
    this.#element("command").textContent = this.light.command(this.run, this.#element("name").value.trim());
    this.#element("link").href = address.href;
    this.#element("link").textContent = address.hash;
    this.#element("copied").textContent = "";
  }

  /** Set the lamps by the page's address, if it has a scenario. */
  read() {
    const pairs = [...new URLSearchParams(window.location.hash.slice(1))];
    if (pairs.some(([option]) => option === "lamp")) {
      this.#element("name").value = pairs.find(([option]) => option === "name")?.[1] ?? "";
      const wrong = this.light.apply(pairs.filter(([option]) => option !== "name"));
      this.#element("wrong").textContent = wrong.length ? `This link also says ${wrong.join(", ")}, which this run does not have.` : "";
    }
    this.show();
    this.#tell();
    this.onChange();
  }

  async #copy(what) {
    const node = this.#element(what);
    try {
      await navigator.clipboard.writeText(what === "link" ? node.href : node.textContent);
      this.#element("copied").textContent = `The ${what} is copied.`;
    } catch {
      // A browser that forbids it: the words are chosen, for the reader to copy.
      window.getSelection().selectAllChildren(node);
      this.#element("copied").textContent = `Press Ctrl+C to copy the ${what}.`;
    }
  }
}
