#!/bin/sh
# Steps of the image: install.sh system | install.sh package DIRECTORY
set -eu

here=$(dirname "$0")
case ${1:-} in
system)
    apt-get update -qq
    apt-get install -y -qq --no-install-recommends \
        g++ libegl1 libegl-mesa0 libgl1-mesa-dri mesa-vulkan-drivers
    rm -rf /var/lib/apt/lists/*
    constraints=$here/constraints.txt
    [ -f "$constraints" ] || constraints=$here/../constraints.txt
    torch=$(sed -n 's/^torch==//p' "$constraints")
    python -m pip install --no-cache-dir "torch==$torch" \
        --index-url https://download.pytorch.org/whl/cpu
    ;;
package)
    python -m pip install --no-cache-dir -c "$here/constraints.txt" \
        "$2[gap,learn,mcap,ray,view,video]"
    bns --version
    ;;
*)
    echo "usage: install.sh system | install.sh package DIRECTORY" >&2
    exit 2
    ;;
esac
