// What the report's 3D view (lidarspectra/mapping/report/page/room-picture.js) takes from three.js.
export {
  Box3,
  BufferAttribute,
  BufferGeometry,
  ColorManagement,
  DoubleSide,
  InstancedBufferAttribute,
  InstancedMesh,
  LinearSRGBColorSpace,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  PerspectiveCamera,
  Raycaster,
  Scene,
  Sphere,
  SphereGeometry,
  Spherical,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
