// Checks GLB files with Khronos' validator: fails on errors and on warnings.
//
//   npm install --prefix target/gltf gltf-validator
//   node scripts/validate-glb.mjs target/gltf avatar.glb [...]
import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { resolve } from "node:path";

const [folder, ...files] = process.argv.slice(2);
if (!files.length) {
  console.error("usage: node scripts/validate-glb.mjs FOLDER_WITH_GLTF_VALIDATOR FILE.glb...");
  process.exit(2);
}
const validator = createRequire(resolve(folder, "index.js"))("gltf-validator");
let failed = false;
for (const file of files) {
  const { issues, info } = await validator.validateBytes(new Uint8Array(readFileSync(file)), { uri: file });
  const { numErrors, numWarnings, numInfos, messages } = issues;
  console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings, ${numInfos} notes; ` +
    `${info.totalVertexCount} vertices, ${info.animationCount} animations`);
  for (const { severity, code, pointer, message } of messages) {
    console.log(`  ${["error", "warning", "note", "hint"][severity]} ${code} at ${pointer}: ${message}`);
  }
  failed ||= numErrors + numWarnings > 0;
}
process.exit(failed ? 1 : 0);
