# SPDX-License-Identifier: Apache-2.0
# An image that is written and cannot get its name: the job ends with the reason, its report tells of no such image, and
# it does not wait for others, as they may wait for it.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" plane -o s.obj --triangles 60 --uv-tiles 3 --texture 16 >/dev/null
job=(transfer s.obj s.obj -o 't.<UDIM>.png' --source-texture 'baseColor=s.<UDIM>.png' --size 64 --threads 1 --no-cache)

# Nothing takes the place of a file that something is mounted on.
touch t.1001.png
mount --bind t.1001.png t.1001.png 2>/dev/null || { echo "SKIPPED: nothing can be mounted here"; exit 0; }
trap 'umount "$work/here/t.1001.png"; rm -rf "$work"' EXIT
# fails ARGUMENT...: the job ends with status 5 or 75 and the reason.
fails() {
  local status=0
  timeout 60 "$POUNCE" "${job[@]}" "$@" >"$out" 2>"$err" || status=$?
  [[ $status == 5 || $status == 75 ]] || fail "status $status"
  err_has 'cannot write t.1001.png: Device or resource busy'
}

fails --report r.json
# Whole images come all the same, and are told of.
python3 - <<'END' || fail "$(cat r.json)"
import json, os
report = json.load(open("r.json"))
images = {image["path"]: image["state"] for image in report["targets"][0]["images"]}
assert images["t.1001.png"] == "not written", images
there = [path for path in ("t.1002.png", "t.1003.png") if os.path.exists(path)]
assert report["outputs"] == there and all(images[path] == "written" for path in there), report["outputs"]
assert report["channels"][0]["images"] == len(there), report["channels"]
END

# The second image is another job's. It may wait for the first, whose claim must not be held meanwhile.
rm -f t.1002.png t.1003.png
exec 9>.t.1002.png.0-0.tmp
flock -n 9
fails --skip-existing
[[ -s t.1003.png ]] || fail "the third image is not there"
