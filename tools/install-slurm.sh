#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Installs Debian's Slurm for tests/farm, without starting any of its services. Not part of tools/install-packages.sh:
# nobody needs it to use or to build pounce. As root; elsewhere the tests skip.
set -eu
command -v sbatch >/dev/null && command -v slurmctld >/dev/null && command -v slurmd >/dev/null &&
  command -v munged >/dev/null && exit 0
policy=/usr/sbin/policy-rc.d
made=no
if [ ! -e $policy ]; then
  printf '#!/bin/sh\nexit 101\n' >$policy
  chmod 755 $policy
  made=yes
fi
status=0
apt-get -qq update || true  # a fresh machine has no lists
DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurmctld slurmd slurm-client munge ||
  status=$?
[ $made = no ] || rm -f $policy
exit $status
