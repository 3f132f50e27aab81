#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Jobs that tasks share on a Slurm of three nodes on this machine, with all that happens to farms: a node is lost, a
# task is killed, the controller is restarted, a disk is full, two workers have one share. Says how evenly shares are
# cut and what sharing costs. Then the same by Snakemake. As root; installs Slurm and Snakemake. About 15 minutes.
# Usage: tools/slow-farm.sh [SIZE of the one large image]   (default 16384), after tools/test.sh
set -euo pipefail
cd "$(dirname "$0")/.."
export POUNCE=$PWD/build/release/pounce POUNCE_FIXTURE=$PWD/build/release/pounce-fixture
[[ -x $POUNCE && -x $POUNCE_FIXTURE ]] || { echo "build first: tools/test.sh" >&2; exit 2; }
tools/install-slurm.sh
DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends snakemake >/dev/null
bash tests/farm/faults.sh "${1:-16384}"
SIZE=2048 bash tests/farm/snakemake.sh
echo "the farm did what one process does"
