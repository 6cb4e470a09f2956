#!/usr/bin/env bash
# Renders every shipped scene into docs/gallery/, at its own quality and on the CPU, and checks that docs/gallery.md shows each of them.
#   benches/gallery.sh [BINARY]    BINARY is target/release/biscale unless given
set -euo pipefail
cd "$(dirname "$0")/.."

binary=$(realpath "${1:-target/release/biscale}")
out=docs/gallery
limit_bytes=2500000

mkdir -p "$out"
rm -f "$out"/*.png
missing=()
for scene in materials/*.toml; do
    name=$(basename "$scene" .toml)
    "$binary" render "$name" -o "$out/$name.png" --size 224x224 --backend cpu --no-cache --quiet
    grep -qF "gallery/$name.png" docs/gallery.md || missing+=("$name")
done

bytes=$(cat "$out"/*.png | wc -c)
echo "$(ls "$out"/*.png | wc -l) images in $out, $bytes bytes"
if [ "$bytes" -gt "$limit_bytes" ]; then
    echo "the images take more than $limit_bytes bytes" >&2
    exit 1
fi
if [ ${#missing[@]} -gt 0 ]; then
    echo "docs/gallery.md does not show: ${missing[*]}" >&2
    exit 1
fi
