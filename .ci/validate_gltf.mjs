// Checks glTF files with the Khronos validator: node .ci/validate_gltf.mjs FILE.glb...
// Needs the npm package gltf-validator: `npm install --prefix DIR gltf-validator`, and NODE_PATH=DIR/node_modules.
// Prints every message; exits 1 when a file has errors or warnings, 2 when it was called wrongly.
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { dirname, join } from "node:path";

// An import would not look into NODE_PATH.
const { validateBytes } = createRequire(import.meta.url)("gltf-validator");

const files = process.argv.slice(2);
if (files.length === 0) {
  console.error("usage: node .ci/validate_gltf.mjs FILE.glb...");
  process.exit(2);
}
let failed = false;
for (const file of files) {
  const report = await validateBytes(new Uint8Array(await readFile(file)), {
    uri: file,
    externalResourceFunction: async (uri) =>
      new Uint8Array(await readFile(join(dirname(file), decodeURIComponent(uri)))),
  });
  const { numErrors, numWarnings, numInfos, messages } = report.issues;
  console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} infos`);
  for (const m of messages) console.log(`  ${m.code} ${m.pointer ?? ""}: ${m.message}`);
  failed ||= numErrors > 0 || numWarnings > 0;
}
process.exit(failed ? 1 : 0);
