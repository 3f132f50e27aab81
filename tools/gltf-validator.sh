#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Khronos' glTF validator, to check models that pounce writes.
# tools/install-oracles.sh FOLDER gets it from npm.
#   gltf-validator.sh compare FOLDER TARGET OUT...  fails where OUT has an error code that TARGET does not have
# compare ends with 77 where node or the validator is missing.
set -eu
command=${1:-} folder=${2:-}
if [ "$command" != compare ] || [ -z "$folder" ]; then
  sed -n '3,6p' "$0" >&2
  exit 2
fi
shift 2
command -v node >/dev/null && [ -d "$folder/node_modules/gltf-validator" ] || exit 77
NODE_PATH=$folder/node_modules exec node - "$@" <<'END'
const fs = require('fs');
const path = require('path');
const validator = require('gltf-validator');

async function errors(file) {
  const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {
    uri: path.basename(file),
    maxIssues: 0,
    externalResourceFunction: async (uri) =>
      new Uint8Array(fs.readFileSync(path.join(path.dirname(file), decodeURIComponent(uri)))),
  });
  return report.issues.messages.filter((message) => message.severity === 0);
}

(async () => {
  const [target, ...outputs] = process.argv.slice(2);
  const known = new Set((await errors(target)).map((error) => error.code));
  for (const output of outputs) {
    for (const error of await errors(output)) {
      if (known.has(error.code)) continue;
      console.log(`${output}: ${error.code} ${error.pointer}: ${error.message}`);
      process.exitCode = 1;
    }
    console.log(`${output}: checked, ${known.size} error codes of the target itself`);
  }
})();
END
