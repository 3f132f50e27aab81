# SPDX-License-Identifier: Apache-2.0
# Triangles that lie exactly on others with other UVs are said and counted; the first in file order is shown.
source "$(dirname "$0")/support.sh"
make_job
cp source.obj plain.obj
echo 'f 1/1 2/2 3/3 4/4' >>source.obj  # copies that show the same
expect 0 transfer source.obj target.obj -o same.png --report same.json
! grep -q 'coincide with others' "$err" || fail 'a warning of copies'
! grep -q 'coincident' same.json || fail 'copies are counted'
echo 'f 1/2 2/3 3/4 4/1' >>source.obj
expect 0 transfer source.obj target.obj -o two.png --report two.json
err_has 'source.obj: 2 of 6 triangles coincide with others that have different UVs'
grep -q '"coincident triangles": 2' two.json || fail 'the report lacks the number'
expect 0 transfer plain.obj target.obj -o plain.png
same_picture two.png plain.png || fail 'not the first one is shown'
