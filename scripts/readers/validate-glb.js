// Validates GLB files with the validator of the Khronos Group; errors and warnings fail.
//
//   node validate-glb.js FILE…

const fs = require("fs");
const validator = require("gltf-validator");

async function main(paths) {
    for (const path of paths) {
        const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(path)));
        const { numErrors, numWarnings, messages } = report.issues;
        if (numErrors + numWarnings > 0) {
            console.error(path, JSON.stringify(messages, null, 1));
            process.exitCode = 1;
        }
    }
    console.log(`${paths.length} GLB files: checked by the glTF validator ${validator.version()}`);
}

main(process.argv.slice(2));
