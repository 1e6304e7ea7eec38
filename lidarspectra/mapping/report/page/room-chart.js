"use strict";
// Elements of the page, and the chart of a spectrum. Words from users are set as text, never as HTML.

class RoomChart {
  static ERROR_BARS = 2; // standard errors, as in the figures

  static html(name, words = "", kind = "") {
    const node = document.createElement(name);
    node.textContent = words;
    if (kind) node.className = kind;
    return node;
  }

  static svg(name, attributes, words = "") {
    const node = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, String(value));
    node.textContent = words;
    return node;
  }

  static signed(number) {
    return number.replace("-", "−");
  }

  static digits(value) {
    return RoomChart.signed(String(Number(value.toPrecision(3))));
  }

  /** A spectrum with error bars (errors may be null); the channel `here` is marked, `before` is drawn thin. */
  static spectrum(bands, values, errors, { highest, unit, label, here = null, before = null }) {
    const { svg, digits } = RoomChart;
    const [width, height, left, right, top, bottom] = [340, 190, 46, 12, 24, 36];
    const span = bands[bands.length - 1] - bands[0] || 1;
    const x = (band) => left + ((bands[band] - bands[0]) / span) * (width - left - right);
    const y = (value) => height - bottom - (Math.min(Math.max(value, 0), highest) / highest) * (height - top - bottom);
    const line = (all, kind) => svg("polyline", { points: all.map((value, band) => `${x(band)},${y(value)}`).join(" "), class: kind });
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
    if (before !== null) drawn.append(line(before, "before"));
    drawn.append(line(values, "line"));
    values.forEach((value, band) => {
      if (errors !== null) {
        const [y1, y2] = [-RoomChart.ERROR_BARS, RoomChart.ERROR_BARS].map((times) => y(value + times * errors[band]));
        drawn.append(svg("line", { x1: x(band), x2: x(band), y1, y2, class: "bar" }));
      }
      drawn.append(svg("circle", { cx: x(band), cy: y(value), r: band === here ? 5 : 2.6, class: band === here ? "here" : "dot" }));
    });
    return drawn;
  }

  static legendBar(title, colors, low, high) {
    const { html } = RoomChart;
    const bar = html("div", "", "room-bar");
    bar.style.background = `linear-gradient(to right, ${colors.join(",")})`;
    const ends = html("div", "", "room-ends");
    ends.append(html("span", low), html("span", title), html("span", high));
    return [bar, ends];
  }
}
