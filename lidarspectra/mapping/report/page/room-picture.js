"use strict";
// The room in 3D by three.js: its objects, the camera, and what is under the pointer. Colours come from room-view.js.

/* global THREE */
class RoomPicture {
  static NEAR_PX = 14; // how close to a point the pointer must come
  static HIDDEN_M = 0.08; // a point so far behind a surface is hidden by it
  static LAMP_COLOR = 0xffd24a;
  static DARK_COLOR = 0x565a60; // of a lamp that is off
  static MARK_COLOR = 0x00a8ff;
  static TURN = Math.PI / 36; // one press of an arrow key
  static ZOOM = 1.15;
  static MOVE = 0.05; // of the distance to the room

  /** Arrays from their type and base64 bytes, wherever they stand. */
  static unpacked(value) {
    if (Array.isArray(value)) return value.map(RoomPicture.unpacked);
    if (value === null || typeof value !== "object") return value;
    if (typeof value.data === "string") {
      const kinds = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, f4: Float32Array };
      return new kinds[value.type](Uint8Array.from(atob(value.data), (letter) => letter.charCodeAt(0)).buffer);
    }
    return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, RoomPicture.unpacked(inner)]));
  }

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {{points: object, surfaces: ?object, lamps: object[]}} room Unpacked data.
   * Throws where the browser has no WebGL.
   */
  constructor(canvas, { points, surfaces, lamps }) {
    this.canvas = canvas;
    this.places = points.places;
    // What is drawn stays in the canvas, so that it is there when the page is printed.
    this.renderer = new THREE.WebGLRenderer({ canvas, alpha: true, antialias: true, preserveDrawingBuffer: true });
    THREE.ColorManagement.enabled = false; // our colours are sRGB already:
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace; // pass them through
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.05, 500);
    this.camera.up.set(0, 0, 1);
    this.rays = new THREE.Raycaster();
    this.surfaces = surfaces === null ? null : this.#surfaceMesh(surfaces);
    this.dots = this.#dotMesh();
    this.sheet = this.#sheetMesh(points.triangles);
    this.lamps = lamps.map((lamp) => this.#lampMesh(lamp));
    this.mark = new THREE.Mesh(
      new THREE.SphereGeometry(1.6 * this.dotRadius, 10, 6),
      new THREE.MeshBasicMaterial({ color: RoomPicture.MARK_COLOR, wireframe: true }),
    );
    this.scene = new THREE.Scene();
    this.scene.add(...[this.surfaces, this.sheet, this.dots, this.mark, ...this.lamps].filter((mesh) => mesh !== null));
    this.controls = new THREE.OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.draw());
    canvas.style.touchAction = "pan-y"; // a finger goes up and down the page, and turns the room sideways
    this.controls.enableZoom = false; // until the picture was pressed: a wheel over it scrolls the page
    canvas.addEventListener("focus", () => (this.controls.enableZoom = true));
    canvas.addEventListener("blur", () => (this.controls.enableZoom = false));
    canvas.addEventListener("pointerdown", () => canvas.focus({ preventScroll: true }));
    canvas.addEventListener("keydown", (event) => this.#key(event));
    new ResizeObserver(() => this.#fit()).observe(canvas.parentElement);
    this.#fit();
    this.reset();
  }

  /** Look down on the whole room from beyond a corner. */
  reset() {
    const box = new THREE.Box3();
    for (const mesh of this.scene.children) if (mesh !== this.mark) box.expandByObject(mesh);
    const ball = box.getBoundingSphere(new THREE.Sphere());
    let distance = 3 * Math.max(ball.radius, 0.5);
    this.camera.near = distance / 500;
    this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(ball.center);
    const way = new THREE.Vector3(-0.55, -0.65, 0.75).normalize();
    for (let round = 0; round < 6; round += 1) {
      this.camera.position.copy(ball.center).addScaledVector(way, distance);
      this.controls.update();
      this.camera.updateMatrixWorld();
      distance *= this.#share(box) / 0.96; // nearer or farther, until the room just fills the picture
    }
    this.draw();
  }

  /** How much of the picture a box fills, from its middle to its rim; 1 is all. */
  #share({ min, max }) {
    let widest = 0;
    for (const x of [min.x, max.x]) for (const y of [min.y, max.y]) for (const z of [min.z, max.z]) {
      const corner = new THREE.Vector3(x, y, z).project(this.camera);
      widest = Math.max(widest, Math.abs(corner.x), Math.abs(corner.y));
    }
    return widest;
  }

  /** Turn by angles [rad], go nearer by a factor, or move aside by shares of the distance. */
  step({ around = 0, over = 0, nearer = 1, right = 0, up = 0 }) {
    const { camera, controls } = this;
    const offset = camera.position.clone().sub(controls.target);
    for (const [axis, share] of [[0, right], [1, up]]) {
      controls.target.addScaledVector(new THREE.Vector3().setFromMatrixColumn(camera.matrix, axis), share * offset.length());
    }
    const angles = new THREE.Spherical().setFromCartesianCoords(offset.x, offset.z, -offset.y); // it has y upwards
    angles.theta += around;
    angles.phi = Math.min(Math.PI - 0.02, Math.max(0.02, angles.phi + over));
    angles.radius /= nearer;
    const turned = new THREE.Vector3().setFromSpherical(angles);
    camera.position.set(turned.x, -turned.z, turned.y).add(controls.target);
    controls.update();
    this.draw();
  }

  /**
   * Colour everything anew.
   * @param {(point: number) => number[]} pointColor sRGB of a point, 0 to 1.
   * @param {?(face: number) => number[]} faceColor The same of a face; null hides the surfaces.
   * @param {boolean} sheet Whether to fill the ground between the points.
   */
  paint(pointColor, faceColor, sheet) {
    for (let point = 0; point < this.dots.count; point += 1) {
      const color = pointColor(point);
      this.dots.instanceColor.array.set(color, 3 * point);
      if (this.sheet) this.sheet.geometry.attributes.color.array.set(color, 3 * point);
    }
    this.dots.instanceColor.needsUpdate = true;
    if (this.sheet) {
      this.sheet.visible = sheet;
      this.sheet.geometry.attributes.color.needsUpdate = true;
    }
    if (this.surfaces) {
      this.surfaces.visible = faceColor !== null;
      if (faceColor !== null) this.#paintFaces(faceColor);
    }
    this.draw();
  }

  /** Let a lamp look as bright as it is dimmed, 0 to 1. */
  shine(lamp, share) {
    const [dark, lit] = [RoomPicture.DARK_COLOR, RoomPicture.LAMP_COLOR];
    const part = (shift) => ((dark >> shift) & 255) * (1 - share) + ((lit >> shift) & 255) * share;
    this.lamps[lamp].material.color.setRGB(...[16, 8, 0].map((shift) => part(shift) / 255));
  }

  /** Put the mark around a point. */
  select(point) {
    this.mark.position.fromArray(this.places, 3 * point);
    this.draw();
  }

  /** What is under the pointer: {point}, {face}, {lamp} by number, or null. */
  pick(event) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top];
    this.rays.setFromCamera(new THREE.Vector2((2 * x) / width - 1, 1 - (2 * y) / height), this.camera);
    const solid = [this.surfaces, ...this.lamps].filter((mesh) => mesh !== null && mesh.visible);
    const hit = this.rays.intersectObjects(solid)[0] ?? null;
    const reach = (hit === null ? Infinity : hit.distance) + RoomPicture.HIDDEN_M;
    let [best, closest] = [null, RoomPicture.NEAR_PX];
    const place = new THREE.Vector3();
    for (let point = 0; point < this.dots.count; point += 1) {
      place.fromArray(this.places, 3 * point);
      if (place.distanceTo(this.camera.position) > reach) continue;
      place.project(this.camera);
      const gap = Math.hypot((place.x + 1) * 0.5 * width - x, (1 - place.y) * 0.5 * height - y);
      if (place.z < 1 && gap < closest) [best, closest] = [point, gap];
    }
    if (best !== null) return { point: best };
    if (hit === null) return null;
    return hit.object === this.surfaces ? { face: hit.faceIndex } : { lamp: this.lamps.indexOf(hit.object) };
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { TURN, ZOOM, MOVE } = RoomPicture;
    const keys = {
      ArrowLeft: { around: -TURN },
      ArrowRight: { around: TURN },
      ArrowUp: { over: -TURN },
      ArrowDown: { over: TURN },
      "+": { nearer: ZOOM },
      "=": { nearer: ZOOM },
      "-": { nearer: 1 / ZOOM },
    };
    const moves = { ArrowLeft: { right: -MOVE }, ArrowRight: { right: MOVE }, ArrowUp: { up: MOVE }, ArrowDown: { up: -MOVE } };
    const step = (event.shiftKey && moves[event.key]) || keys[event.key];
    if (step) this.step(step);
    else if (event.key === "Home") this.reset();
    else return;
    event.preventDefault();
  }

  draw() {
    this.renderer.render(this.scene, this.camera);
  }

  #fit() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  #surfaceMesh({ vertices, faces, lowest, cell }) {
    const places = new Float32Array(3 * faces.length); // corners are not shared: every triangle has a colour of its own
    faces.forEach((vertex, corner) => {
      for (let axis = 0; axis < 3; axis += 1) places[3 * corner + axis] = lowest[axis] + cell * vertices[3 * vertex + axis];
    });
    const geometry = RoomPicture.#geometry(places);
    geometry.setAttribute("color", new THREE.BufferAttribute(new Uint8Array(3 * faces.length), 3, true));
    geometry.computeVertexNormals();
    const normals = geometry.attributes.normal.array;
    this.shade = Float32Array.from({ length: faces.length / 3 }, (_, face) => {
      const [x, y, z] = normals.subarray(9 * face, 9 * face + 3);
      return 0.87 + 0.13 * (0.35 * x + 0.25 * y + 0.9 * z); // so that edges are seen
    });
    // A triangle is not drawn from behind: one looks into the room through its walls and ceiling.
    const offset = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
    return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ vertexColors: true, ...offset }));
  }

  #paintFaces(faceColor) {
    const { array } = this.surfaces.geometry.attributes.color;
    for (let face = 0; face < this.shade.length; face += 1) {
      const color = faceColor(face).map((value) => 255 * value * this.shade[face]);
      for (let corner = 0; corner < 3; corner += 1) array.set(color, 9 * face + 3 * corner);
    }
    this.surfaces.geometry.attributes.color.needsUpdate = true;
  }

  #dotMesh() {
    const count = this.places.length / 3;
    const geometry = RoomPicture.#geometry(this.places);
    geometry.computeBoundingSphere();
    this.dotRadius = Math.min(0.05, Math.max(0.012, (0.3 * geometry.boundingSphere.radius) / Math.sqrt(count)));
    const ball = new THREE.SphereGeometry(this.dotRadius, ...(count > 1000 ? [6, 4] : [12, 8])); // many are seen small
    const dots = new THREE.InstancedMesh(ball, new THREE.MeshBasicMaterial(), count);
    const place = new THREE.Matrix4();
    for (let point = 0; point < count; point += 1) {
      dots.setMatrixAt(point, place.makeTranslation(...this.places.subarray(3 * point, 3 * point + 3)));
    }
    dots.instanceColor = new THREE.InstancedBufferAttribute(new Float32Array(3 * count), 3);
    return dots;
  }

  #sheetMesh(triangles) {
    if (triangles.length === 0) return null;
    const geometry = RoomPicture.#geometry(this.places);
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(this.places.length), 3));
    geometry.setIndex(new THREE.BufferAttribute(triangles, 1));
    const look = { vertexColors: true, side: THREE.DoubleSide, transparent: true, opacity: 0.85, depthWrite: false };
    return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial(look));
  }

  #lampMesh({ corners }) {
    const fan = [];
    for (let corner = 2; corner < corners.length / 3; corner += 1) fan.push(0, corner - 1, corner);
    const geometry = RoomPicture.#geometry(corners).setIndex(fan);
    return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ color: RoomPicture.LAMP_COLOR, side: THREE.DoubleSide }));
  }

  static #geometry(places) {
    return new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(places, 3));
  }
}
