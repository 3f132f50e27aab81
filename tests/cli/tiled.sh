# SPDX-License-Identifier: Apache-2.0
# Files in tiles, with levels (.tx), the compression of EXR, and outputs without alpha.
source "$(dirname "$0")/support.sh"
refused '--mipmap applies only to EXR or TIFF output, but o.png is not' transfer a.glb b.glb -o o.png --mipmap
refused '--tile-size applies only to EXR or TIFF output, but o.jpg is not' transfer a.glb b.glb -o o.jpg --tile-size 64
refused '--tile-size applies only to EXR or TIFF output, but o.glb' transfer a.glb b.glb -o o.glb --tile-size 64
refused 'expected a multiple of 16 from 16 to 1024' transfer a.glb b.glb -o o.exr --tile-size 40
refused '--exr-compression applies only to EXR output, but o.tx is not' transfer a.glb b.glb -o o.tx --exr-compression piz
refused '--exr-compression: got "dwaa", expected none, rle, zips, zip or piz' \
  transfer a.glb b.glb -o o.exr --exr-compression dwaa
refused '--drop-alpha contradicts --alpha' transfer a.ply b.glb -o o.png --alpha --drop-alpha
refused 'an image that is painted over keeps its channels' transfer a.glb b.glb -o o.png --onto p.png --drop-alpha
refused '.tx is for renderers' maps b.glb -o '<CHANNEL>.tx'
rejected --tile-size 0 8 1040 many
for ending in png jpg glb; do
  refused 'images as .png, .jpg, .jpeg, .tif, .tiff, .tx or .exr' transfer a.glb b.glb -o "o.x$ending" --mipmap
done

"$POUNCE_FIXTURE" plane -o s.obj --triangles 200 --texture 200 --uv-tiles 2 >/dev/null
"$POUNCE_FIXTURE" plane -o t.obj --triangles 200 --uv-tiles 2 >/dev/null
run() { expect 0 transfer s.obj t.obj --source-texture 'baseColor=s.<UDIM>.png' "$@"; }
run -o 't.<UDIM>.tx' --no-cache
run -o 't.<UDIM>.png' --no-cache
same_picture t.1002.tx t.1002.png || fail 'the first level is not the picture'
expect 0 inspect t.1001.tx
out_has 'written by pounce, job '
out_has '200 x 200, 3 channels, u8, srgb, tiff, tiles 64 x 64, 8 levels'
expect 0 inspect t.1001.tx --json
for text in '"tile_width": 64' '"tile_height": 64' '"levels": 8'; do out_has "$text"; done
expect 0 inspect t.1001.png --json
for text in '"tile_width": 0' '"tile_height": 0' '"levels": 1'; do out_has "$text"; done
# The images of a model, too.
quad named t.1001.tx
expect 0 inspect named.obj
out_has 'tiff, tiles 64 x 64, 8 levels'
run -o x.exr --mipmap --tile-size 32 --size 331x200 --no-cache
expect 0 inspect x.exr
out_has 'openexr, tiles 32 x 32, 9 levels'
run -o x.tif --tile-size 128 --no-cache
expect 0 inspect x.tif
out_has 'tiff, tiles 128 x 128'
! grep -q levels "$out" || fail 'a level is counted that is not there'
rm x.*
# The same bytes at any budget and number of threads; with the compression of EXR, too.
for layout in '-o x.tx' '-o x.exr --mipmap --tile-size 32 --exr-compression piz' '-o x.tif --tile-size 128'; do
  run $layout --size 700x333 --no-cache --threads 1
  file=$(ls x.*)
  before=$(md5sum <$file)
  for more in '--threads 5' '--memory 8MiB' '--cache warm' '--cache warm --threads 2 --memory 64MiB'; do
    rm $file
    run $layout --size 700x333 $more
    [[ $(md5sum <$file) == "$before" ]] || fail "other bytes: $layout $more"
  done
  rm $file
done

# What renderers' tools make of it.
if command -v maketx >/dev/null && command -v iinfo >/dev/null && command -v oiiotool >/dev/null; then
  run -o rows.exr --size 331x200 --no-cache
  for kind in 't.1001.tx t.1001.png' 'x.exr rows.exr'; do
    read -r ours rows <<<"$kind"
    [[ $ours != x.exr ]] || run -o x.exr --mipmap --size 331x200 --no-cache
    maketx "$rows" -o "theirs.${ours##*.}" >/dev/null
    # stats FILE: least, largest and mean of each channel, and which levels there are. OpenImageIO 2.4 tells the
    # first level's figures for all.
    stats() { iinfo --stats "$1" | grep -E '^ +Stats (Min|Max|Avg):|MIP-map'; }
    stats "$ours" >ours.txt
    stats "theirs.${ours##*.}" >theirs.txt
    [[ $(wc -l <ours.txt) -ge 24 ]] || fail "$ours has few levels: $(cat ours.txt)"
    # In 8 bits the figures are counted in 255ths.
    unit=$([[ $ours == *.tx ]] && echo 1.0 || echo 0.00392)
    paste -d '|' ours.txt theirs.txt | awk -F '|' -v unit=$unit '
      /MIP/ { if ($1 != $2) exit 1; next }
      { n = split($1, a, /[ :(]+/); m = split($2, b, /[ :(]+/); if (n != m) exit 1
        for (i = 4; i <= n; ++i) if (a[i] ~ /^[0-9.-]+$/ && (a[i] - b[i] > unit || b[i] - a[i] > unit)) exit 1 }' ||
      fail "$ours is not as maketx makes it: $(paste -d '|' ours.txt theirs.txt)"
    for level in 0 1 4 7; do
      oiiotool "$ours" --selectmip $level "theirs.${ours##*.}" --selectmip $level --fail 0.00393 --diff >"$out" 2>&1 ||
        fail "level $level of $ours differs"
    done
  done
  iinfo -v t.1001.tx | grep -q 'textureformat: "Plain Texture"' || fail 'not a texture to renderers'
  ! iinfo -v t.1001.tx | grep -qi datetime || fail 'a time stamp'
else
  echo 'SKIPPED: needs maketx, iinfo and oiiotool'
fi

# Halves in a .tx are an EXR in it, of a source of halves without a word; as maketx has them, and at half the size.
if command -v oiiotool >/dev/null && command -v maketx >/dev/null; then
  oiiotool s.1001.png -d half -o half.exr
  quad hs half.exr && quad ht
  half() { expect 0 transfer hs.obj ht.obj --no-cache "$@"; }
  half -o h.exr
  half -o h.tx
  expect 0 inspect h.tx
  out_has '200 x 200, 3 channels, half, lin_rec709, openexr, tiles 64 x 64, 8 levels'
  out_has 'written by pounce, job '
  same_picture h.tx h.exr || fail 'the first level is not the picture'
  maketx --format openexr h.exr -o theirs.tx
  for level in 0 1 4 7; do
    oiiotool h.tx --selectmip $level theirs.tx --selectmip $level --fail 0.00393 --diff >"$out" 2>&1 ||
      fail "level $level of h.tx differs"
  done
  iinfo -v h.tx | grep -q 'textureformat: "Plain Texture"' || fail 'not a texture to renderers'
  half -o f.tx --depth float
  expect 0 inspect f.tx
  out_has 'float, lin_rec709, tiff, tiles 64 x 64, 8 levels'
  (($(wc -c <h.tx) * 10 < $(wc -c <f.tx) * 8)) || fail 'halves take as much room as floats'
  half -o h.tx --skip-existing
  err_has 'skipped 1'
  head -c $(($(wc -c <h.tx) - 100)) h.tx >cut.tx && mv cut.tx h.tx # what is not whole is made again
  half -o h.tx --skip-existing
  ! grep -q skipped "$err" || fail 'half a file was kept'
  half -o z.tx --depth half --exr-compression piz
  same_picture z.tx h.exr || fail 'another compression, another picture'
  iinfo -v z.tx | grep -q 'compression: "piz"' || fail 'z.tx is compressed otherwise'
  expect 2 transfer hs.obj ht.obj -o o.tx --no-cache --depth half --output-colorspace srgb
  err_has 'EXR is linear'
  expect 0 transfer ht.obj ht.obj --source-texture baseColor=h.tx -o back.exr --no-cache
  same_picture back.exr h.exr || fail 'read back as another picture'
  rm h.* f.tx z.tx theirs.tx back.exr
else
  echo 'SKIPPED: needs maketx and oiiotool'
fi

# Another layout is another job; the same is kept, .tx like others.
job=(-o 't.<UDIM>.tx' --no-cache --skip-existing)
run "${job[@]}"
err_has 'skipped 2'
run "${job[@]}" --tile-size 32
! grep -q skipped "$err" || fail 'files of other tiles were kept'
run "${job[@]}" --tile-size 32
err_has 'skipped 2'

# As a source, and painted over, such a file is its first level.
run -o 't.<UDIM>.tx' --no-cache
expect 0 transfer s.obj t.obj --source-texture 'baseColor=t.<UDIM>.tx' -o 'u.<UDIM>.png' --no-cache
run -o 'w.<UDIM>.png' --no-cache
same_picture u.1001.png w.1001.png || fail 'read back as another picture'
cp t.1001.tx old.tx
expect 0 transfer s.obj t.obj --source-texture 'baseColor=s.<UDIM>.png' --onto 't.<UDIM>.tx' -o 't.<UDIM>.tx' --no-cache
same_picture t.1001.tx old.tx || fail 'painted over itself it is another picture'

# Alpha: straight in a TIFF of rows, times alpha where there are levels; --drop-alpha leaves the colour.
if command -v oiiotool >/dev/null; then
  oiiotool --create 16x16 4 --fill:color=0.5,0.25,0.125,0.5 16x16 -d uint8 -o a.png
  quad as a.png && quad at
  expect 0 transfer as.obj at.obj -o a.tif --no-cache
  expect 0 transfer as.obj at.obj -o a.tx --no-cache
  same_picture a.tif a.png || fail 'a TIFF lost its straight alpha'
  oiiotool --info -v a.tif | grep -q UnassociatedAlpha || fail 'a.tif does not say that its alpha is straight'
  ! oiiotool --info -v a.tx | grep -q UnassociatedAlpha || fail 'a.tx says that its alpha is straight'
  expect 0 compare a.tx a.png --min-psnr 45
  expect 2 transfer as.obj at.obj -o a.jpg --no-cache
  err_has 'JPEG does not support alpha; choose .png, .tif or .exr, or --drop-alpha'
  expect 0 transfer as.obj at.obj -o a.jpg --no-cache --drop-alpha
  expect 0 transfer as.obj at.obj -o plain.png --no-cache --drop-alpha
  oiiotool --info plain.png | grep -q '3 channel' || fail 'alpha was not dropped'
  oiiotool a.png --unpremult --ch R,G,B -d uint8 -o colour.png
  expect 0 compare plain.png colour.png --min-psnr 45
else
  echo 'SKIPPED: needs oiiotool'
fi

# The old file stays until the last level is in the new one, whatever happens.
run -o whole.tx --size 3072 --no-cache
# kill_at NAME FRACTION ARGUMENT...: a transfer of 3072² to NAME, killed once its progress says more than FRACTION.
kill_at() {
  kill_job "$2" transfer s.obj t.obj --source-texture 'baseColor=s.<UDIM>.png' -o "$1" --size 3072 --no-cache
}
for fraction in 0 0.3 0.6 0.77; do
  echo 'an old picture' >k.tx
  kill_at k.tx $fraction
  [[ $(tr -d '\0' <k.tx) == 'an old picture' ]] || cmp k.tx whole.tx || fail "half a picture after SIGKILL at $fraction"
done
((kills >= 2)) || fail "only $kills of 4 kills met a job at work"
[[ -z $(find . -name '.*.tmp') ]] || fail 'something was left behind'
