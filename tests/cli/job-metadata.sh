# SPDX-License-Identifier: Apache-2.0
# Every output says which job made it: the same for the same content and options wherever files lie, another for
# anything that matters.
source "$(dirname "$0")/support.sh"
make_job
run() { expect 0 transfer "$@" -q; }
# job_of FILE: sets $job.
job_of() {
  expect 0 inspect "$1"
  job=$(sed -n 's/^written by pounce, job \([0-9a-f]\{32\}\)$/\1/p' "$out")
  [[ -n $job ]] || fail "$1 does not say its job"
}

# Every format, and not a byte that depends on place, names, time, threads, memory or cache.
mkdir -p there/deep
for f in source.obj source.mtl target.obj skin.ppm; do cp $f "there/deep/$f"; done
mv there/deep/target.obj there/deep/goal.obj
touch -d '2001-01-01' there/deep/*
jobs=' '
for ending in png jpg tif exr; do
  run source.obj target.obj -o "o.$ending" --size 40 --coverage "m.$ending"
  run there/deep/source.obj there/deep/goal.obj -o "there/other.$ending" --size 40 --threads 1 --memory 64MiB --no-cache
  cmp "o.$ending" "there/other.$ending" || fail "$ending: other bytes elsewhere"
  job_of "o.$ending"
  image_job=$job
  [[ $jobs != *" $job "* ]] || fail "$ending: the job of another format"
  jobs+="$job "
  job_of "m.$ending"
  [[ $job == "$image_job" ]] || fail "$ending: the mask's job"
  grep -qa 'pounce 0\.' "o.$ending" || fail "$ending: no software"
  ! grep -qaE "$(date +%Y)[:-]" "o.$ending" || fail "$ending: a date"
done
run source.obj target.obj -o o.tiff --size 40
cmp o.tif o.tiff || fail 'the spelling of an ending'
expect 0 inspect o.png --json
job_of o.png
first=$job
expect 0 inspect o.png --json
out_has "\"job\": \"$first\""

# Another job: an option, an input's content. The same: what is so anyway, said aloud.
other() {
  run "$@"
  job_of p.png
  [[ $job != "$first" ]] || fail "the same job: $*"
}
other source.obj target.obj -o p.png --size 40 --max-angle 60.0000001
far=$job
other source.obj target.obj -o p.png --size 40 --max-angle 60
[[ $job != "$far" ]] || fail 'a small difference of a number is lost'
other source.obj target.obj -o p.png --size 41
other source.obj target.obj -o p.png --size 40 --padding 3
other source.obj target.obj -o p.png --size 40 --depth u16
image new.ppm 16 16 200 100 51
other source.obj target.obj -o p.png --size 40 --source-texture baseColor=new.ppm
other source.obj target.obj -o p.png --onto o.png
{ cat target.obj; echo '# moved'; } >moved.obj
other source.obj moved.obj -o p.png --size 40
run source.obj target.obj -o p.png --size 40 --depth u8 --channels baseColor --min-coverage 1
cmp o.png p.png || fail 'the same, said aloud'

# A tile alone is the tile of the whole.
"$POUNCE_FIXTURE" plane -o t.obj --triangles 400 --uv-tiles 2 >/dev/null
run source.obj t.obj -o 'a.<UDIM>.png' --size 32
run source.obj t.obj -o 'b.<UDIM>.png' --size 32 --tiles 1002
cmp a.1002.png b.1002.png || fail 'a tile of a selection'
job_of a.1001.png
first=$job
job_of a.1002.png
[[ $job != "$first" ]] || fail 'two tiles, one job'

# Maps.
expect 0 maps target.obj -o 'map.<CHANNEL>.exr' --size 32 -q
job_of map.normal.exr
first=$job
job_of map.position.exr
[[ $job != "$first" ]] || fail 'two maps, one job'
expect 0 maps target.obj -o 'map.<CHANNEL>.exr' --size 33 -q
job_of map.normal.exr
[[ $job != "$first" ]] || fail 'the size of a map'

# Models.
"$POUNCE_FIXTURE" plane -o g.glb --triangles 400 --texture 16 >/dev/null
run g.glb g.glb -o one.glb
run g.glb g.glb -o one.gltf
job_of one.glb
first=$job
job_of one.gltf
[[ $job != "$first" ]] || fail 'a .gltf is no .glb'
grep -qa '"extras":{"pounce":{"job":"'"$first"'","software":"pounce 0' one.glb || fail 'asset.extras'
# Written into a model that says another job, its own is said.
run g.glb one.glb -o two.glb
job_of two.glb
[[ $job != "$first" ]] || fail "the target's job"
! grep -qa "$first" two.glb || fail "the target's job is still there"
