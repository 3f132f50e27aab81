# SPDX-License-Identifier: Apache-2.0
# What a refusal names is never more than what works, also of a mesh that is too large to be read only to say so: it is
# needed to read it, to make its tangents, or for the job. Each step gets further, to what --plan names.
source "$(dirname "$0")/support.sh"
"$POUNCE_FIXTURE" head -o in --triangles 700000 --texture 16 --target-size 16 >/dev/null
image flat.ppm 4 4 128 128 255
job=(transfer in/head_src.glb in/head_same.glb -o o.png --source-texture normal=flat.ppm --channels normal --size 16
  --no-cache --plan)
expect 0 "${job[@]}" --memory 4GiB
bytes=$(sed -nE 's/^least memory .*\(([0-9]+) bytes\)$/\1/p' "$out")
least=$(((bytes + 1048575) >> 20)) named=1 steps=() got=4
while [[ $got == 4 ]]; do
  got=0
  "$POUNCE" "${job[@]}" --memory "${named}MiB" >"$out" 2>"$err" || got=$?
  [[ $got == 4 ]] || break
  next=$(sed -nE 's/.*run it with --memory ([0-9]+)MiB$/\1/p' "$err")
  ((next > named)) || fail "with $named MiB it asks for $next MiB"
  ((next <= least)) || fail "it asks for $next MiB, and $least MiB work"
  named=$next
  steps+=("$(sed -nE 's/.* for (.*); run it.*/\1/p' "$err")")
done
[[ $got == 0 && $named == "$least" ]] || fail "exit status $got with $named MiB, of $least MiB"
[[ ${steps[*]} == "reading in/head_src.glb the tangents of in/head_src.glb the tangents of in/head_same.glb" ]] ||
  fail "the steps: ${steps[*]}"
