# SPDX-License-Identifier: Apache-2.0
# pounce cache info, list, verify, prune, clear; --cache-limit.
source "$(dirname "$0")/support.sh"
refused 'info, list, verify, prune, clear' cache
refused '--older-than: got "soon"' cache prune --older-than soon
refused '--older-than: got "5"' cache prune --older-than 5
refused '--to: got "much"' cache prune --to much
rejected --cache-limit 0 -1 much
expect 0 cache prune --help
out_has '--older-than'
expect 0 cache info
[[ ! -e $XDG_CACHE_HOME ]] || fail 'looking at a cache makes one'
make_job
expect 5 cache info --cache skin.ppm
err_has 'skin.ppm: is a file'
expect 0 cache clear --cache nowhere
[[ ! -e nowhere ]] || fail 'clearing a cache makes one'
expect 0 transfer source.obj target.obj -o o.png
expect 0 cache list
out_has 'skin.ppm, 16 x 16, 3 x u8'
out_has 'source.obj as a source'
out_has 'target.obj as a target'
out_has 'hits of a target on a source, 16 x 16'
expect 0 cache list --json
out_has '"made_from": "skin.ppm, 16 x 16, 3 x u8"'
expect 0 cache info --json
grep -A2 '"colour"' "$out" | grep -q '"objects": 1' || fail 'info does not count the image'
expect 0 cache verify
out_has '4 packs'
pack=$(ls "$XDG_CACHE_HOME"/pounce/v3/colour/*.pack)
printf 'X' | dd of="$pack" bs=1 seek=300 conv=notrunc status=none
expect 6 cache verify
out_has "$pack"
expect 6 cache verify --remove
out_has 'removed'
expect 0 cache verify
out_has '3 packs'
expect 0 cache prune --older-than 1h
out_has 'removed 0 packs'
expect 0 cache prune --older-than 0s
out_has 'removed 3 packs'
# A limit that holds nothing: the same picture, nothing kept, said once.
expect 0 transfer source.obj target.obj -o p.png --cache-limit 4KiB
cmp o.png p.png || fail 'the limit changes the picture'
[[ $(grep -c 'cache-limit' "$err") == 1 ]] || fail 'not said once'
expect 0 cache list
silent "$out"
expect 0 transfer source.obj target.obj -o p.png --cache-limit none
expect 0 cache clear
out_has 'removed 4 packs'
# A file in the way of a cache that was asked for; one that was not is done without.
expect 5 transfer source.obj target.obj -o p.png --cache skin.ppm
err_has '--no-cache'
rm -rf "$XDG_CACHE_HOME"
echo >"$XDG_CACHE_HOME"
expect 0 transfer source.obj target.obj -o p.png
err_has 'the cache cannot be used'

# A second cache is read, and never written: not even when it was used.
expect 0 transfer source.obj target.obj -o q.png --cache second
find second -type f -exec touch -d 2001-01-01 {} +
find second -type f -printf '%p %T@ %s\n' | sort >before
expect 0 transfer source.obj target.obj -o q.png --cache first --cache-readonly second --report r.json
find second -type f -printf '%p %T@ %s\n' | sort | diff before - || fail 'the second cache was written'
[[ -z $(find first -name '*.pack') ]] || fail 'what the second cache has was made again'
grep -q '"images_decoded": 0' r.json || fail 'an image was decoded though the second cache has it'
expect 0 transfer source.obj target.obj -o q.png --cache first --cache-readonly nowhere
err_has '--cache-readonly names no folder'
pack=$(find second/v3/colour -name '*.pack' | head -n 1)
printf 'x' | dd of="$pack" bs=1 seek=$(($(stat -c %s "$pack") - 20)) conv=notrunc status=none
expect 0 transfer source.obj target.obj -o w.png --cache first --cache-readonly second
cmp q.png w.png || fail 'a damaged pack of the second cache changed the image'
