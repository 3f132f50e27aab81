# SPDX-License-Identifier: Apache-2.0
# --report writes every key of docs/report.md, to a file or to the standard output.
source "$(dirname "$0")/support.sh"
make_job
expect 0 transfer source.obj target.obj -o o.png --report report.json -q
silent "$out"
silent "$err"
only_files o.png report.json skin.ppm source.mtl source.obj target.obj
cp report.json "$out"
for key in version command isa threads stages name wall_s cpu_s cached source gaussians filtered images_decoded \
  target texels covered filled empty overlapping udims tiles read written bytes temp_peak source_store \
  target_store memory budget leased_peak peak_rss least warnings outputs failure inputs options targets channels \
  images enough max_distance distances fit state disk_most kept notes; do
  out_has "\"$key\":"
done
for text in '"texels": 256' '"covered": 256' '"empty": 0' '"images_decoded": 1' '"o.png"'; do out_has "$text"; done
expect 0 transfer source.obj target.obj -o o.png --report - -q
out_has '"covered": 256'
[[ $(head -c 1 "$out") == '{' && $(tail -n 1 "$out") == '}' ]] || fail 'more than the report on the output'
rm report.json skin.ppm
expect 5 transfer source.obj target.obj -o o.png --report report.json --no-cache
grep -q '"kind": "storage"' report.json || fail 'no report of a job that failed'
# A report never takes the place of an input or a result.
image skin.ppm 16 16 200 100 50
for name in target.obj skin.ppm o.1001.png ./SOURCE.OBJ; do
  cp target.obj before.obj
  expect 2 transfer source.obj target.obj -o 'o.<UDIM>.png' --report "$name"
  err_has 'expected a name for JSON'
  cmp target.obj before.obj || fail "$name was replaced"
done
# What a killed job left of it goes; what is replaced keeps its permissions.
rm -f r.json
touch .r.json.123-0.tmp
echo '{}' >r.json
chmod 600 r.json
expect 0 transfer source.obj target.obj -o o.png --report r.json -q
[[ $(stat -c %a r.json) == 600 ]] || fail "mode 600 became $(stat -c %a r.json)"
[[ ! -e .r.json.123-0.tmp ]] || fail 'a leftover stayed'
grep -q '"covered": 256' r.json || fail 'the report was not replaced'
