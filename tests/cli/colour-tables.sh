# SPDX-License-Identifier: Apache-2.0
# Tables of an OpenColorIO configuration are looked at before it opens them: files, in its folder, within the budget.
source "$(dirname "$0")/support.sh"
make_job
# config TABLE: with a space that is made of that table, and one that leads there by way of others.
config() {
  mkdir -p studio/luts
  cat >studio/c.ocio <<CONFIG
ocio_profile_version: 2
search_path: luts
roles: {default: raw}
file_rules:
  - !<Rule> {name: Default, colorspace: default}
displays:
  d:
    - !<View> {name: v, colorspace: raw}
looks:
  - !<Look>
    name: grade
    process_space: lin_rec709
    transform: !<FileTransform> {src: "$1", interpolation: linear}
colorspaces:
  - !<ColorSpace>
    name: raw
    isdata: true
  - !<ColorSpace>
    name: lin_rec709
  - !<ColorSpace>
    name: table
    to_scene_reference: !<FileTransform> {src: "$1", interpolation: linear}
  - !<ColorSpace>
    name: far
    to_scene_reference: !<GroupTransform>
      children:
        - !<ColorSpaceTransform> {src: table, dst: lin_rec709}
        - !<ExponentTransform> {value: 1}
  - !<ColorSpace>
    name: look
    to_scene_reference: !<LookTransform> {src: lin_rec709, dst: lin_rec709, looks: grade}
CONFIG
}
table() { printf 'Version 1\nFrom 0 1\nLength 3\nComponents 1\n{\n0\n0.25\n1\n}\n' >"$1"; }
job() { # STATUS SPACE OPTIONS...
  rm -f o.png
  # What waits for a pipe is ended.
  expect "$1" transfer source.obj target.obj --size 16 -o o.png --ocio studio/c.ocio --output-colorspace lin_rec709 \
    --source-colorspace "$2" "${@:3}"
  [[ $1 == 0 || ! -e o.png ]] || fail 'an output of a job that failed'
}
POUNCE_REAL=$POUNCE
printf '#!/bin/sh\nexec timeout -k 1 20 %s "$@"\n' "$POUNCE_REAL" >bounded && chmod +x bounded
POUNCE=$PWD/bounded

config t.spi1d
for space in table far look; do
  rm -f studio/luts/t.spi1d
  table studio/luts/t.spi1d
  job 0 $space
  [[ -e o.png ]] || fail 'no output'

  # A pipe, a device and a folder are no tables, --allow-external or not.
  rm studio/luts/t.spi1d
  mkfifo studio/luts/t.spi1d
  job 5 $space
  err_has 't.spi1d: cannot read: it is a pipe, not a file'
  rm studio/luts/t.spi1d
  ln -s /dev/zero studio/luts/t.spi1d
  job 3 $space
  err_has "is outside of the configuration's folder"
  job 5 $space --allow-external --memory 64MiB
  err_has 't.spi1d: cannot read: it is a device, not a file'
  rm studio/luts/t.spi1d

  # Other files of the machine.
  table elsewhere.spi1d
  ln -s "$PWD/elsewhere.spi1d" studio/luts/t.spi1d
  job 3 $space
  err_has "studio/c.ocio: its table"
  err_has "is outside of the configuration's folder; copy it into that folder, or add --allow-external"
  job 0 $space --allow-external
done
rm studio/luts/t.spi1d
for path in ../../elsewhere.spi1d "$PWD/elsewhere.spi1d"; do
  config "$path"
  job 3 table
  expect 3 gaussians source.obj -o o.ply --ocio studio/c.ocio --source-colorspace table
  job 0 table --allow-external
  expect 0 gaussians source.obj -o o.ply --ocio studio/c.ocio --source-colorspace table --allow-external
done
# A configuration that is reached by a link has two folders.
config t.spi1d
table studio/luts/t.spi1d
ln -s studio/c.ocio linked.ocio
cp -r studio/luts luts
expect 0 transfer source.obj target.obj --size 16 -o o.png --ocio linked.ocio --source-colorspace table --output-colorspace srgb

# A table that is large, or says so.
truncate -s 10G studio/luts/t.spi1d
job 4 table --memory 64MiB
err_has 'the tables of studio/c.ocio need at least'
rm studio/luts/t.spi1d
{ printf 'Version 1\nFrom 0 1\nLength 100000\nComponents 1\n{\n'; seq -f '%.5g' 0 0.00001 0.99999; printf '}\n'; } >studio/luts/t.spi1d
job 4 table --memory 40MiB
least=$(sed -n 's/.*--memory \([0-9]*MiB\)$/\1/p' "$err")
job 0 table --memory "$least"

# One that refers to others, where the first may be anything, in any spelling.
for text in '<ProcessList id="a" version="1.7"><Reference path="pipe" inBitDepth="32f" outBitDepth="32f"/></ProcessList>' \
  '<!DOCTYPE a [<!ENTITY x "&#60;Reference path=&#34;pipe&#34;/>">]><ProcessList id="a" version="1.7">&x;</ProcessList>'; do
  config t.ctf
  printf '<?xml version="1.0"?>%s' "$text" >studio/luts/t.ctf
  job 3 table
  err_has 'references other files or defines XML entities'
  if command -v iconv >/dev/null; then
    printf '<?xml version="1.0" encoding="UTF-16"?>%s' "$text" | iconv -t UTF-16 >studio/luts/t.ctf
    job 3 table
    err_has 'references other files or defines XML entities'
  fi
done

# What is missing or cannot be read is no damaged input.
config lost.spi1d
job 5 table
err_has 'cannot convert from "table"'
if [[ $(id -u) -ne 0 ]]; then
  config t.spi1d
  chmod 0 studio/luts/t.spi1d
  job 5 table
fi
