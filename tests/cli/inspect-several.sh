# SPDX-License-Identifier: Apache-2.0
# inspect takes several files: text after text, or a JSON list. A bad one does not hide the others; it is the status.
source "$(dirname "$0")/support.sh"
check_json() { ! command -v python3 >/dev/null || python3 - "$out"; } # a script on the standard input
make_job
expect 0 inspect source.obj skin.ppm
out_has 'source.obj: mesh'
out_has 'skin.ppm: image'
expect 0 inspect skin.ppm source.obj --json
check_json <<'END' || fail 'no JSON list of two'
import json, sys
files = json.load(open(sys.argv[1]))
assert [(f["file"], f["type"]) for f in files] == [("skin.ppm", "image"), ("source.obj", "mesh")], files
END
expect 0 inspect skin.ppm --json
[[ $(head -c 1 "$out") == '{' ]] || fail 'of one file an object'
echo 'hello' >letter.txt
expect 3 inspect letter.txt source.obj missing.glb
err_has 'letter.txt'
err_has 'missing.glb'
out_has 'source.obj: mesh'
expect 5 inspect missing.glb letter.txt skin.ppm --json
check_json <<'END' || fail 'no JSON list of three'
import json, sys
files = json.load(open(sys.argv[1]))
assert [f["file"] for f in files] == ["missing.glb", "letter.txt", "skin.ppm"], files
assert "cannot open" in files[0]["error"] and "width" in files[2], files
END
