// Writes lidarspectra/mapping/report/page/three.js: one script that defines THREE, with its licence at the top.
// npm ci && npm run build
import { readFile } from "node:fs/promises";
import { build } from "esbuild";

const version = JSON.parse(await readFile("node_modules/three/package.json", "utf8")).version;
const licence = (await readFile("node_modules/three/LICENSE", "utf8")).trim();
await build({
  entryPoints: ["three.js"],
  outfile: "../../lidarspectra/mapping/report/page/three.js",
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "THREE",
  target: "es2020",
  charset: "ascii",
  legalComments: "none",
  banner: { js: `/* three.js ${version}, the part that this page uses. https://threejs.org\n\n${licence} */` },
});
