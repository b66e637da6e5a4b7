#!/bin/sh
# A node of a Ray cluster:
#   node.sh head NODES CAMPAIGN.toml DIRECTORY   runs the campaign once NODES are there
#   node.sh worker HEAD:PORT                     helps until the head is gone
set -eu

case ${1:-} in
head)
    ray start --head --port=6379 --disable-usage-stats
    until [ "$(ray list nodes --filter state=ALIVE --format json | grep -c node_id)" -ge "$2" ]; do
        sleep 2
    done
    resume=
    [ -d "$4" ] && resume=--resume
    # shellcheck disable=SC2086
    bns campaign run "$3" --out "$4" --engine ray --ray-address 127.0.0.1:6379 $resume
    bns campaign table "$4"
    ray stop
    ;;
worker)
    until ray start --address="$2" --disable-usage-stats; do
        sleep 2
    done
    while ray status --address="$2" >/dev/null 2>&1; do
        sleep 5
    done
    ;;
*)
    echo "usage: node.sh head NODES CAMPAIGN.toml DIRECTORY | node.sh worker HEAD:PORT" >&2
    exit 2
    ;;
esac
