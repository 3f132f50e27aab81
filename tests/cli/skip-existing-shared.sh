# SPDX-License-Identifier: Apache-2.0
# --skip-existing: an option that says what holds without it is as if it were not given; jobs on the same outputs share
# them; the claim of a process that was killed stops nobody.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" plane -o s.obj --triangles 400 --uv-tiles 6 --texture 16 >/dev/null
"$POUNCE_FIXTURE" plane -o t.obj --triangles 400 --uv-tiles 6 >/dev/null
job=(transfer s.obj t.obj -o 't.<UDIM>.png' --source-texture 'baseColor=s.<UDIM>.png' --size 64 --skip-existing --no-cache)
expect 0 "${job[@]}"

# Each default said aloud, one by one and all together.
defaults=('--filter cubic' '--max-distance 5%' '--max-angle 80' '--min-coverage 0' '--factors apply' '--method surface'
  '--target-uv-set 0' '--source-uv-set 0' '--source-axes x,y,z' '--target-axes=+x,+y,+z' '--normal-y up'
  '--source-colorspace srgb' '--output-colorspace srgb' '--sigma 0.5' '--depth u8' '--padding 0'
  '--channels baseColor')
for default in "${defaults[@]}"; do
  read -ra said <<<"$default"
  expect 0 "${job[@]}" "${said[@]}"
  err_has 'skipped 6 files (up to date)'
done
read -ra said <<<"${defaults[*]}"
expect 0 "${job[@]}" "${said[@]}"
err_has 'skipped 6 files (up to date)'
for other in '--filter tent' '--max-distance 4%' '--output-colorspace display-p3'; do # and others still count
  read -ra said <<<"$other"
  expect 0 "${job[@]}" "${said[@]}" --plan
  out_has 't.1001.png'
done
expect 0 transfer s.obj t.obj -o 'l.<UDIM>.tx' --source-texture 'baseColor=s.<UDIM>.png' --size 64 --skip-existing --no-cache
expect 0 transfer s.obj t.obj -o 'l.<UDIM>.tx' --source-texture 'baseColor=s.<UDIM>.png' --size 64 --skip-existing --no-cache \
  --tile-size 64 --mipmap
err_has 'skipped 6 files (up to date)'

# Two jobs at once: every output is made by one of them, both end with all of them there, and nothing else is left.
sum() { cat t.10*.png | md5sum; }
whole=$(sum)
big=("${job[@]/64/1500}" --threads 1)
rm t.10*.png
"$POUNCE" "${big[@]}" --report a.json 2>a.txt &
first=$!
"$POUNCE" "${big[@]}" --report b.json 2>b.txt || fail "the second job: $(cat b.txt)"
[[ $(ls t.10*.png | wc -l) == 6 ]] || fail 'not everything was there when the second job ended'
wait $first || fail "the first job: $(cat a.txt)"
[[ $(cat a.txt b.txt | grep -c '^wrote t') == 6 ]] || fail "outputs were made twice: $(cat a.txt b.txt)"
[[ -z $(find . -name '.*.tmp') ]] || fail 'claims were left'
rm t.10*.png a.* b.*
expect 0 "${job[@]}"
[[ $(sum) == "$whole" ]] || fail 'other bytes'

# A job that holds a claim and is killed: its claim is nobody's.
rm t.1003.png
: >.t.1003.png.0-0.tmp
expect 0 "${job[@]}"
err_has 'wrote t.1003.png'
[[ ! -e .t.1003.png.0-0.tmp ]] || fail 'the claim of a dead process was left'

# A claim of a living one: waited for, or status 75.
rm t.1003.png
exec 9>.t.1003.png.0-0.tmp
flock 9
expect 75 "${job[@]}" --no-wait
err_has 'is writing outputs of this job'
"$POUNCE" "${job[@]}" --progress json 2>waiting.txt &
waiting=$!
for ((i = 0; i < 200; ++i)); do
  if grep -q 'waiting for ' waiting.txt; then break; fi
  sleep 0.05
done
grep -q 'waiting for ' waiting.txt || fail 'the job did not wait'
flock -u 9
wait $waiting || fail 'the job that waited'
[[ $(sum) == "$whole" ]] || fail 'other bytes after waiting'
