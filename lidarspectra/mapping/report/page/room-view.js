"use strict";
// The channel slider, the 3D view's colours, and the spectrum of what is pointed at.
// The data come from lidarspectra/mapping/report/room_view.py; words from users are set as text, never as HTML.

/* global RoomPicture */
(() => {
  const FIRST_BAND_NM = 560; // near the eye's best
  const ERROR_BARS = 2; // standard errors, as in the figures
  const BURIED_COLOR = [0.54, 0.56, 0.59];

  const element = (name) => document.getElementById(`room-${name}`);
  const room = RoomPicture.unpacked(JSON.parse(element("data").textContent));
  const { bands, points, materials, surfaces, lamps } = room;
  const count = points.numbers.length;
  const nearest = (from, to) => (Math.abs(from - FIRST_BAND_NM) <= Math.abs(to - FIRST_BAND_NM) ? from : to);
  const state = {
    band: bands.indexOf(bands.reduce(nearest)),
    surfaces: surfaces === null ? "none" : "scanned",
    point: 0, // selected
    over: null, // pointed at, as RoomPicture.pick gives it
  };

  // ---- numbers and colours

  const irradiance = (point, band) => points.irradiance[point * bands.length + band];
  const standardError = (point, band) => points.error[point * bands.length + band];
  const limits = () => (element("shared").checked ? [0, points.highest] : points.scales[state.band]);
  const signed = (number) => number.replace("-", "−");
  const digits = (value) => signed(String(Number(value.toPrecision(3))));
  const inUnit = (value, places = 3) => signed((value * points.factor).toPrecision(places));
  const channel = () => `${digits(bands[state.band])} nm`;
  const srgb = (linear) => (linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055); // IEC 61966-2-1
  const fromHex = (hex) => [1, 3, 5].map((start) => parseInt(hex.slice(start, start + 2), 16) / 255);
  const scale = room.colors.map(fromHex);

  function pointColor(point) {
    if (points.buried[point]) return BURIED_COLOR;
    const [low, high] = limits();
    const place = Math.round(((irradiance(point, state.band) - low) / (high - low)) * (scale.length - 1));
    return scale[Math.min(scale.length - 1, Math.max(0, place))];
  }

  /** A function from face to colour, or null where surfaces are hidden. */
  function faceColors() {
    if (state.surfaces === "none") return null;
    if (state.surfaces === "scanned") {
      return (face) => [0, 1, 2].map((part) => surfaces.scanned[3 * face + part] / 255);
    }
    const ofMaterial = materials.map((material) =>
      state.surfaces === "reflectance" ? Array(3).fill(srgb(material.reflectance[state.band])) : fromHex(material[state.surfaces]),
    );
    return (face) => ofMaterial[surfaces.materials[face]];
  }

  // ---- words and the chart

  function html(name, words = "", kind = "") {
    const node = document.createElement(name);
    node.textContent = words;
    if (kind) node.className = kind;
    return node;
  }

  function svg(name, attributes, words = "") {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, String(value));
    node.textContent = words;
    return node;
  }

  /** A spectrum with error bars (errors may be null); the present channel is marked. */
  function chart(values, errors, { highest, unit, label }) {
    const [width, height, left, right, top, bottom] = [340, 210, 46, 12, 24, 36];
    const span = bands[bands.length - 1] - bands[0] || 1;
    const x = (band) => left + ((bands[band] - bands[0]) / span) * (width - left - right);
    const y = (value) => height - bottom - (Math.min(Math.max(value, 0), highest) / highest) * (height - top - bottom);
    const drawn = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label });
    for (const level of [0, 0.5 * highest, highest]) {
      drawn.append(svg("line", { x1: left, x2: width - right, y1: y(level), y2: y(level), class: "grid" }));
      drawn.append(svg("text", { x: left - 5, y: y(level) + 4, "text-anchor": "end" }, digits(level)));
    }
    const every = Math.ceil(bands.length / 6);
    bands.forEach((nm, band) => {
      if (band % every === 0) drawn.append(svg("text", { x: x(band), y: height - 18, "text-anchor": "middle" }, digits(nm)));
    });
    drawn.append(svg("text", { x: (left + width - right) / 2, y: height - 3, "text-anchor": "middle" }, "wavelength [nm]"));
    drawn.append(svg("text", { x: 2, y: 12 }, `${label} [${unit}]`));
    drawn.append(svg("polyline", { points: values.map((value, band) => `${x(band)},${y(value)}`).join(" "), class: "line" }));
    values.forEach((value, band) => {
      if (errors !== null) {
        const [y1, y2] = [-ERROR_BARS, ERROR_BARS].map((times) => y(value + times * errors[band]));
        drawn.append(svg("line", { x1: x(band), x2: x(band), y1, y2, class: "bar" }));
      }
      const here = band === state.band;
      drawn.append(svg("circle", { cx: x(band), cy: y(value), r: here ? 5 : 2.6, class: here ? "here" : "dot" }));
    });
    return drawn;
  }

  function showPoint(point) {
    const [x, y, z] = [...points.places.subarray(3 * point, 3 * point + 3)].map((metres) => signed(metres.toFixed(2)));
    const value = `${inUnit(irradiance(point, state.band))} ± ${inUnit(standardError(point, state.band), 2)} ${points.unit}`;
    const lines = [
      html("strong", `Point ${points.numbers[point]}`),
      html("span", `x ${x}, y ${y}, z ${z} m`),
      html("span", `${channel()}: ${value}`),
    ];
    if (points.illuminance !== null) lines.push(html("span", `illuminance: ${digits(points.illuminance[point])} lx`));
    if (points.buried[point]) lines.push(html("span", "buried in furniture or a wall: its values are meaningless"));
    element("reading").replaceChildren(...lines);
    const values = bands.map((_, band) => points.factor * irradiance(point, band));
    const errors = bands.map((_, band) => points.factor * standardError(point, band));
    const highest = Math.max(...values.map((each, band) => each + ERROR_BARS * errors[band])) || 1;
    element("chart").replaceChildren(chart(values, errors, { highest, unit: points.unit, label: "irradiance" }));
  }

  function showMaterial({ name, category, area, reflectance, deviation }) {
    element("reading").replaceChildren(
      html("strong", name),
      html("span", `${category}; ${digits(area)} m² of it`),
      html("span", `${channel()}: reflectance ${reflectance[state.band].toFixed(2)}`),
    );
    element("chart").replaceChildren(chart(reflectance, deviation, { highest: 1, unit: "1", label: "reflectance" }));
  }

  function showReading() {
    if (state.over?.face !== undefined) showMaterial(materials[surfaces.materials[state.over.face]]);
    else if (state.over?.lamp !== undefined) {
      element("reading").replaceChildren(html("strong", lamps[state.over.lamp].name), html("span", "lamp"));
      element("chart").replaceChildren();
    } else showPoint(state.over?.point ?? state.point);
  }

  function legendBar(title, colors, low, high) {
    const bar = html("div", "", "room-bar");
    bar.style.background = `linear-gradient(to right, ${colors.join(",")})`;
    const ends = html("div", "", "room-ends");
    ends.append(html("span", low), html("span", title), html("span", high));
    return [bar, ends];
  }

  function showLegend() {
    const parts = legendBar(`${channel()} [${points.unit}]`, room.colors, ...limits().map((value) => digits(value * points.factor)));
    if (state.surfaces === "reflectance") {
      const greys = [0, 0.1, 0.25, 0.5, 0.75, 1].map((linear) => `rgb(${Array(3).fill(Math.round(255 * srgb(linear)))}) ${100 * linear}%`);
      parts.push(...legendBar(`reflectance at ${channel()}`, greys, "0", "1"));
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
    element("band-name").textContent = channel();
    element("band").setAttribute("aria-valuetext", channel());
    picture?.paint(pointColor, faceColors(), element("sheet").checked);
    showLegend();
    showReading();
  }

  function select(point) {
    state.point = point;
    element("point").value = points.numbers[point];
    picture?.select(point);
    showReading();
  }

  element("band").max = bands.length - 1;
  element("band").value = state.band;
  element("band").addEventListener("input", (event) => {
    state.band = Number(event.target.value);
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
    });
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons !== 0) return; // turning
      state.over = picture.pick(event);
      canvas.style.cursor = state.over?.point === undefined ? "" : "pointer";
      showReading();
    });
    canvas.addEventListener("pointerleave", () => {
      state.over = null;
      showReading();
    });
  }

  select(0);
  repaint();
})();
