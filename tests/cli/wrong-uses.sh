# SPDX-License-Identifier: Apache-2.0
# What people type by mistake, or as other programs have it, is told with what was meant.
source "$(dirname "$0")/support.sh"
for words in 'help' '--help'; do
  expect 0 $words
  out_has 'Usage: pounce COMMAND'
done
expect 0 help transfer
out_has 'Usage: pounce transfer'
expect 0 version
out_has 'pounce 0.'
refused '"transfr" is not a command; choose transfer, apply, maps, gaussians, proxy, mesh, inspect, compare, cache, prepare, assemble, status or submit; did you mean transfer?' transfr a b
refused '"purge": cache needs one of: info, list, verify, prune, clear; did you mean clear?' cache purge
refused 'did you mean verify?' cache verfy
refused '--ouput is unknown; did you mean --output?' transfer a.glb b.glb --ouput o.png
refused '--max-dist is unknown; did you mean --max-distance?' transfer a.glb b.glb -o o.png --max-dist 1
refused '-out: long options begin with two dashes; did you mean --output?' transfer a.glb b.glb -out o.png
refused '--memory: got "2" and "GiB", expected a single word: --memory 2GiB' transfer a.glb b.glb -o o.png --memory 2 GiB
refused 'compare takes A and B' compare a.png b.png c.png
refused '--size: given more than once; specify it once' transfer a.glb b.glb -o o.png --size 8 --size 9
refused 'basecolour: unknown channel; did you mean baseColor?' transfer a.glb b.glb -o o.png --channels basecolour
refused 'emisive: unknown channel; did you mean emissive?' transfer a.glb b.glb -o o.png --channels emisive
for token in '[UDIM]' '{udim}' 'x.UDIM'; do
  refused '<UDIM> (1001) or <UVTILE> (u1_v1) for a tile' transfer a.glb b.glb -o "o.$token.png"
done
refused 'expected a number from 0 to 89.9' transfer a.glb b.glb -o o.png --max-angle 95

# The same as JSON where that is asked for, and in the report.
for progress in '--progress json' '--progress=json'; do
  expect 2 transfer a.glb b.glb -o o.png --bogus $progress --report r.json
  [[ $(wc -l <"$err") == 1 && $(cat "$err") == '{"end":"failed","exit_status":2,"kind":"usage","message":"'* ]] || fail 'no JSON'
  grep -q '"kind": "usage"' r.json || fail 'no report'
  grep -q '"command": "transfer"' r.json || fail 'the report has no command'
  rm r.json
done
expect 2 transfr a b --progress json
[[ $(cat "$err") == '{"end":"failed",'* ]] || fail 'no JSON of an unknown command'
expect 2 transfer a.glb b.glb -o o.png --size wide -q --progress json
err_has 'pounce: error: --size'

# A file whose channel is missing, and which could be baked.
quad plain
expect 3 transfer plain.obj plain.obj -o n.png --channels normal --size 8
err_has '--bake normal'

# A target needs no material file; a source's is missed.
image skin.ppm 4 4 9 9 9
quad source skin.ppm
quad target skin.ppm
rm target.mtl
expect 0 transfer source.obj target.obj -o o.png --no-cache
! grep -q 'target.mtl' "$err" || fail 'the material file of a target is missed'
rm source.mtl
expect 3 transfer source.obj target.obj -o o.png --no-cache
err_has 'source.mtl cannot be read'
