"use strict";
// The live page: the map of now in the room, lamps, sensors, means, trend and alarm, as the server sends them.
// Words from users are set as text, never as HTML.

/* global RoomPicture, THREE */
(() => {
  const SENSOR_COLOR = 0x1f78ff;
  const DOUBT_COLOR = 0xe0362c;
  const SENSOR_RADIUS = 1.5; // of a point's
  const MAX_PERCENT = 1000; // of a deviation: in the dark it would be any number, and more says no more
  const STALE_S = 5; // without news the page says so
  const PLATE_PADDING_PX = 17;
  const DRAW_EVERY_MS = 400;
  const TREND_EVERY_MS = 20_000;
  const BURIED_COLOR = [0.54, 0.56, 0.59];

  const element = (id) => document.getElementById(id);
  const room = RoomPicture.unpacked(JSON.parse(element("room-data").textContent));
  const about = JSON.parse(element("live-data").textContent);
  const { points, surfaces, materials } = room;
  const count = points.numbers.length;
  const fromHex = (hex) => [1, 3, 5].map((start) => parseInt(hex.slice(start, start + 2), 16) / 255);
  const scale = room.colors.map(fromHex);
  const state = { now: null, quantity: 0, over: null, heard: 0, trend: null, connected: true, waiting: null, timer: null };

  const digits = (value, places = 3) => {
    if (value === null || !Number.isFinite(value)) return "–";
    const written = Math.abs(value) >= 1000 ? String(Math.round(value)) : String(Number(value.toPrecision(places)));
    return written.replace("-", "−");
  };
  const node = (name, words = "", kind = "") => {
    const made = document.createElement(name);
    made.textContent = words;
    if (kind) made.className = kind;
    return made;
  };
  const svg = (name, attributes, words = "") => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
    made.textContent = words;
    return made;
  };
  /** The next of 1, 2, 5, 10 ... that is not below a value, so that a scale stands still while the light moves a little. */
  const roundUp = (value) => {
    if (!(value > 0)) return 1;
    const ten = 10 ** Math.floor(Math.log10(value));
    return [1, 1.5, 2, 3, 5, 7, 10].map((each) => each * ten).find((each) => each >= value * 0.999);
  };

  // ---- the map

  const shown = () => {
    const { value, sd } = state.now.map;
    const start = (state.quantity % about.quantities.length) * count;
    if (state.quantity < about.quantities.length) return (point) => value[start + point];
    return (point) => Math.min((100 * sd[point]) / Math.max(value[point], 1e-9), MAX_PERCENT); // of the first quantity
  };
  const unit = () => (state.quantity < about.quantities.length ? about.quantities[state.quantity].unit : "%");
  const title = () =>
    state.quantity < about.quantities.length ? about.quantities[state.quantity].words : `deviation of ${about.quantities[0].words}`;

  function highest() {
    const at = shown();
    let top = 0;
    for (let point = 0; point < count; point += 1) if (!points.buried[point]) top = Math.max(top, at(point));
    return roundUp(top);
  }

  function faceColors() {
    const kind = element("live-surfaces").value;
    if (kind === "none" || surfaces === null) return null;
    if (kind === "scanned") return (face) => [0, 1, 2].map((part) => surfaces.scanned[3 * face + part] / 255);
    const ofMaterial = materials.map((material) => fromHex(material.daylight));
    return (face) => ofMaterial[surfaces.materials[face]];
  }

  const picture = startPicture();
  const balls = picture === null ? [] : about.sensors.map(({ place }) => ball(place));

  function startPicture() {
    try {
      return new RoomPicture(element("room-canvas"), room);
    } catch (cause) {
      element("room-canvas").hidden = true;
      element("room-message").hidden = false;
      element("room-message").textContent = `This browser cannot show 3D here (${cause.message}); the numbers need no 3D.`;
      return null;
    }
  }

  function ball(place) {
    const look = new THREE.MeshBasicMaterial({ color: SENSOR_COLOR });
    const mesh = new THREE.Mesh(new THREE.SphereGeometry(SENSOR_RADIUS * picture.dotRadius, 14, 10), look);
    mesh.position.fromArray(place);
    picture.scene.add(mesh);
    return mesh;
  }

  function paint() {
    if (state.now === null) return;
    const at = shown();
    const top = highest();
    if (picture !== null) {
      const doubted = new Set(state.now.alarm === null ? [] : state.now.alarm.sensors);
      balls.forEach((mesh, index) => mesh.material.color.setHex(doubted.has(about.sensors[index].name) ? DOUBT_COLOR : SENSOR_COLOR));
      const color = (point) => {
        if (points.buried[point]) return BURIED_COLOR;
        return scale[Math.min(scale.length - 1, Math.max(0, Math.round((at(point) / top) * (scale.length - 1))))];
      };
      picture.paint(color, faceColors(), element("live-sheet").checked);
    }
    const bar = node("div", "", "room-bar");
    bar.style.background = `linear-gradient(to right, ${room.colors.join(",")})`;
    const ends = node("div", "", "room-ends");
    ends.append(node("span", "0"), node("span", `${title()} [${unit()}]`), node("span", digits(top)));
    element("live-legend").replaceChildren(bar, ends);
    showPoint();
  }

  function showPoint() {
    const point = state.over?.point;
    const lamp = state.over?.lamp;
    if (state.now === null) return;
    if (lamp !== undefined) element("live-point").textContent = `Lamp ${room.lamps[lamp].name}`;
    else if (point === undefined) element("live-point").textContent = "Point at a dot of the map for its light.";
    else {
      const readouts = about.quantities.map(({ words, unit: each }, quantity) => {
        const [value, sd] = [state.now.map.value, state.now.map.sd].map((array) => array[quantity * count + point]);
        return `${words} ${digits(value)} ± ${digits(sd, 2)} ${each}`;
      });
      element("live-point").textContent = `Point ${points.numbers[point]}: ${readouts.join(", ")}`;
    }
  }

  // ---- numbers

  function showMeans() {
    const cards = about.quantities.map(({ words, unit: each }, quantity) => {
      const card = node("div");
      const value = node("dd", `${digits(state.now.mean[quantity])} ${each}`);
      value.append(node("small", `± ${digits(state.now.mean_sd[quantity], 2)}, mean of the map`));
      card.append(node("dt", words), value);
      return card;
    });
    element("live-means").replaceChildren(...cards);
  }

  function showLamps() {
    const doubted = new Set(state.now.alarm === null ? [] : state.now.alarm.lamps);
    const rows = state.now.lamps.map(({ state: level, sd, said, full, daylight }, index) => {
      const name = about.lamps[index];
      const row = node("li", "", doubted.has(name) ? "doubt" : "");
      const share = daylight ? `${digits(level)} ± ${digits(sd, 2)} × the run's` : `${digits((100 * level) / full)} ± ${digits((100 * sd) / full, 2)} %`;
      const words = said === null ? "" : ` (switch: ${digits(100 * said)} %)`;
      row.append(node("span", name + words), node("span", share));
      const meter = document.createElement("meter");
      meter.max = daylight ? Math.max(1, level) : 1.2 * full;
      meter.value = level;
      meter.setAttribute("aria-label", name);
      row.append(meter);
      return row;
    });
    element("live-lamps").replaceChildren(...rows);
  }

  function showSensors() {
    const doubted = new Set(state.now.alarm === null ? [] : state.now.alarm.sensors);
    const rows = state.now.sensors.map((sensor, index) => {
      const row = node("tr");
      row.append(node("td", about.sensors[index].name, doubted.has(about.sensors[index].name) ? "doubt" : ""));
      row.append(node("td", sensor.lux === null ? "–" : `${digits(sensor.lux)} lx`, "number"));
      row.append(node("td", digits(sensor.ratio), "number"));
      about.quantities.forEach((_, quantity) => {
        row.append(node("td", `${digits(sensor.value[quantity])} ± ${digits(sensor.sd[quantity], 2)}`, "number"));
      });
      return row;
    });
    element("live-sensors").replaceChildren(...rows);
  }

  function showAlarm() {
    const { alarm } = state.now;
    const box = element("live-alarm");
    const words = alarm === null ? "" : alarm.sentences.join("\n");
    if (box.dataset.words === words) return; // an alarm is read out once
    box.dataset.words = words;
    box.hidden = alarm === null;
    if (alarm === null) return box.replaceChildren();
    const since = new Date(1000 * alarm.since).toLocaleTimeString();
    box.replaceChildren(node("p", `Readings do not fit since ${since}`), ...alarm.sentences.map((each) => node("p", each)));
  }

  function showStatus() {
    const status = element("live-status");
    const age = state.now === null ? Infinity : about.recording ? 0 : (performance.now() - state.heard) / 1000;
    let words = "Waiting for the first reading.";
    if (!state.connected) words = "The server is gone; this page asks again until it answers.";
    else if (state.now !== null && age > STALE_S) words = `No news for ${Math.round(age)} s.`;
    else if (state.now !== null && state.now.last === null) words = "No reading yet; the light is unknown.";
    else if (state.now !== null) {
      const read = new Date(1000 * state.now.last).toLocaleTimeString();
      words = `${about.recording ? "Recording; its last" : "Last"} reading ${read}; chi-square ${digits(state.now.chi_square)} of ${state.now.count} numbers.`;
    }
    if (status.textContent !== words) status.textContent = words;
    status.className = state.now !== null && state.connected && age <= STALE_S && state.now.last !== null ? "on" : "off";
  }

  // ---- the trend

  function showTrend() {
    if (state.trend === null) return;
    const quantity = state.quantity % about.quantities.length;
    const { times, values } = state.trend;
    const width = Math.max(280, element("live-trend").clientWidth - 2 * PLATE_PADDING_PX);
    const [height, left, right, top, bottom] = [220, 54, 14, 22, 26];
    const last = times.length ? times[times.length - 1] : 0;
    const span = Math.max(600, Math.min(86400, times.length ? last - times[0] : 0));
    const high = roundUp(Math.max(0, ...values.map((row) => row[quantity] ?? 0)));
    const x = (time) => width - right - ((last - time) / span) * (width - left - right);
    const y = (value) => height - bottom - (value / high) * (height - top - bottom);
    const { words, unit: each } = about.quantities[quantity];
    const label = `mean ${words} [${each}]`;
    const drawn = svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": `${label} over the last 24 hours` });
    for (const level of [0, high / 2, high]) {
      drawn.append(svg("line", { x1: left, x2: width - right, y1: y(level), y2: y(level), class: "grid" }));
      drawn.append(svg("text", { x: left - 6, y: y(level) + 4, "text-anchor": "end" }, digits(level)));
    }
    for (const share of [0, 0.25, 0.5, 0.75, 1]) {
      const when = new Date(1000 * (last - share * span)).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
      const anchor = share === 0 ? "end" : share === 1 ? "start" : "middle";
      if (times.length) drawn.append(svg("text", { x: x(last - share * span), y: height - 6, "text-anchor": anchor }, when));
    }
    drawn.append(svg("text", { x: 4, y: 13 }, label));
    let line = [];
    const flush = () => {
      if (line.length) drawn.append(svg("polyline", { points: (line.length > 1 ? line : [line[0], line[0]]).join(" "), class: "line" }));
      line = [];
    };
    times.forEach((time, step) => {
      if (step > 0 && time - times[step - 1] > 2 * state.trend.step) flush();
      const value = values[step][quantity];
      if (value === null) flush();
      else line.push(`${x(time).toFixed(1)},${y(value).toFixed(1)}`);
    });
    flush();
    element("live-trend").replaceChildren(drawn);
  }

  async function askTrend() {
    try {
      const answer = await fetch("trend.json");
      if (answer.ok) state.trend = await answer.json();
      showTrend();
    } catch {
      showStatus(); // the server is gone; the next time asks again
    }
  }

  // ---- from the server, and from the user

  /** Show a message; of several that come faster than this device draws, the latest. */
  function take(event) {
    state.waiting = event.data;
    if (state.timer === null) state.timer = setTimeout(showWaiting, Math.max(0, state.heard + DRAW_EVERY_MS - performance.now()));
  }

  function showWaiting() {
    state.timer = null;
    const isFirst = state.now === null;
    const message = JSON.parse(state.waiting);
    message.map = RoomPicture.unpacked(message.map);
    state.now = message;
    state.connected = true;
    for (const show of [showMeans, showLamps, showSensors, showAlarm, paint]) show();
    state.heard = performance.now();
    showStatus();
    if (isFirst) askTrend();
  }

  element("live-title").textContent = about.title;
  document.title = `${about.title} – live`;
  about.quantities.forEach(({ words }, index) => element("live-quantity").append(new Option(words, String(index))));
  element("live-quantity").append(new Option(`deviation of ${about.quantities[0].words}`, String(about.quantities.length)));
  for (const words of ["sensor", "reads", "read over expected", ...about.quantities.map((each) => `${each.words} [${each.unit}]`)]) {
    element("live-heads").append(node("th", words, words === "sensor" ? "" : "number"));
  }
  element("live-quantity").addEventListener("change", (event) => {
    state.quantity = Number(event.target.value);
    paint();
    showTrend();
  });
  element("live-surfaces").value = surfaces === null ? "none" : "scanned";
  for (const id of ["live-surfaces", "live-sheet"]) element(id).addEventListener("change", paint);
  element("live-reset").addEventListener("click", () => picture?.reset());
  if (picture !== null) {
    picture.mark.visible = false;
    const { canvas } = picture;
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons !== 0) return; // turning
      state.over = picture.pick(event);
      showPoint();
    });
    canvas.addEventListener("pointerleave", () => {
      state.over = null;
      showPoint();
    });
    picture.paint(() => BURIED_COLOR, faceColors(), false); // until there is a map
  }
  const source = new EventSource("events");
  source.addEventListener("now", take);
  source.addEventListener("error", () => {
    state.connected = false;
    showStatus();
  });
  new ResizeObserver(showTrend).observe(document.body);
  setInterval(showStatus, 1000);
  setInterval(askTrend, TREND_EVERY_MS);
})();
