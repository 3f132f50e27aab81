# SPDX-License-Identifier: Apache-2.0
# Eight processes that start together with an empty cache, as tasks of a farm do: each image is decoded once, each store
# is built once, and the bytes are those of one process.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" channels -o in >/dev/null
job=(transfer in/channels_src.glb in/channels_target.glb --size 600 --channels baseColor,occlusion,metallicRoughness)
expect 0 "${job[@]}" -o 'quiet.<CHANNEL>.png' --cache quiet --report quiet.json
images=$(sed -nE 's/.*"images_decoded": ([0-9]+).*/\1/p' quiet.json)
[[ $images == 3 ]] || fail "one process decodes $images images, not 3"
pids=()
for n in 1 2 3 4 5 6 7 8; do
  "$POUNCE" "${job[@]}" -o "$n.<CHANNEL>.png" --cache cache --report $n.json -q &
  pids+=($!)
done
for pid in "${pids[@]}"; do wait "$pid" || fail "status $? of one of eight"; done
decoded=$(cat [1-8].json | sed -nE 's/.*"images_decoded": ([0-9]+).*/\1/p' | awk '{ all += $1 } END { print all }')
[[ $decoded == "$images" ]] || fail "eight processes decoded $decoded images, not $images"
for n in 1 2 3 4 5 6 7 8; do
  for channel in baseColor occlusion metallicRoughness; do
    cmp $n.$channel.png quiet.$channel.png || fail "other bytes of process $n"
  done
done
same_packs() { diff <(cd quiet/v3 && find . -name '*.pack' | sort) <(cd cache/v3 && find . -name '*.pack' | sort); }
same_packs || fail 'the cache of eight holds other packs than that of one'
expect 0 cache verify --cache cache
