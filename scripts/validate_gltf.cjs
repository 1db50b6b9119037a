// Holds GLB files against the Khronos glTF validator; prints one line of JSON a file: its errors and warnings.
//
//     NODE_PATH=.venv/gltf/node_modules node scripts/validate_gltf.cjs WORLD/meshes/*.glb
//
// Exits 1 if any file has an error. `make check` installs the validator (npm: gltf-validator).
const fs = require("fs");
const validator = require("gltf-validator");

async function main(paths) {
  let errors = 0;
  for (const path of paths) {
    const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(path)), { maxIssues: 0 });
    const degenerate = report.issues.messages.filter((m) => m.code === "ACCESSOR_INDEX_TRIANGLE_DEGENERATE").length;
    const severe = report.issues.messages.filter((m) => m.severity < 2).slice(0, 5);
    errors += report.issues.numErrors;
    console.log(JSON.stringify({ path, errors: report.issues.numErrors, warnings: report.issues.numWarnings,
      degenerate, first: severe.map((m) => `${m.code} at ${m.pointer}: ${m.message}`) }));
  }
  process.exit(errors ? 1 : 0);
}

main(process.argv.slice(2));
