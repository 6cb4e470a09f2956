#!/usr/bin/env bash
# Prints one line per output of the program: `threads scene variant sha256`.
#
#     benches/fingerprint.sh [BINARY [PATTERN]] > before.txt
#
# Run it on two versions of the program on one machine and compare the two files with `diff`: equal hashes mean equal bytes.
# BINARY defaults to target/release/biscale. With PATTERN, only outputs whose `threads scene variant` matches this extended
# regular expression are made; for example `' draft$'`.
#
# - A command that fails prints `FAILED` and its exit code in place of the hash, so that failures are compared as well.
# - Milliseconds and seconds differ between runs. They are removed from JSON before it is hashed (Python 3 does that).
# - A table that is exported holds a description in words, which is part of its bytes. `export-csv-values` leaves it out.
#
# benches/pairs.csv holds 512 direction pairs [radians] made of the points 1 to 512 of the Halton sequence in the bases
# 2, 3, 5 and 7. In this order: 256 with both directions up to 88 degrees; 160 within 0.1 of the mirror direction; 32 with the
# light, the viewer or both at 90 degrees (1.570796 is just above the horizon in floating point, 1.5707963267948966 is on it);
# 24 with one or both at the pole; 16 with both directions equal; 20 grazing; 4 below the horizon.
set -u

root=$(cd "$(dirname "$0")/.." && pwd) || exit 1
biscale=$(realpath "${1:-$root/target/release/biscale}") || exit 2
pattern=${2:-}
pairs=$root/benches/pairs.csv
if [ ! -x "$biscale" ]; then
    echo "fingerprint.sh: found no program at $biscale; build it with cargo build --release" >&2
    exit 2
fi

tmp=$(mktemp -d) || exit 1
trap 'rm -rf "$tmp"' EXIT
trap 'exit 130' INT TERM
cd "$tmp" || exit 1
export BISCALE_CACHE=off

scenes=$("$biscale" materials | awk '{ print $1 }')
if [ -z "$scenes" ]; then
    echo "fingerprint.sh: $biscale materials lists no scene" >&2
    exit 1
fi
# All five objects of the paper and the sphere; grooves, pyramids, rods, a weave and a height-field.
six="default table4_cup table4_pillow table4_plate table4_skirt table4_teapot"

# Whether `THREADS SCENE VARIANT` is asked for.
wanted() { [ -z "$pattern" ] || grep -Eq -- "$pattern" <<< "$1 $2 $3"; }

# line THREADS SCENE VARIANT RC FILE: prints the hash of a file, or that the command failed.
line() {
    if [ "$4" -ne 0 ]; then
        echo "$1 $2 $3 FAILED $4"
    elif [ ! -f "$5" ]; then
        echo "$1 $2 $3 FAILED without a file"
    else
        echo "$1 $2 $3 $(sha256sum < "$5" | cut -d' ' -f1)"
    fi
}

# printed THREADS SCENE VARIANT FILTER ARGUMENTS...: standard output of the program after a filter.
printed() {
    local threads=$1 scene=$2 variant=$3 filter=$4
    shift 4
    wanted "$threads" "$scene" "$variant" || return 0
    RAYON_NUM_THREADS=$threads "$biscale" "$@" > printed.raw 2> /dev/null
    local rc=$?
    if [ $rc -eq 0 ]; then
        "$filter" < printed.raw > printed.txt
        rc=$?
    fi
    line "$threads" "$scene" "$variant" $rc printed.txt
}

# written THREADS SCENE VARIANT ENDING ARGUMENTS...: a file that the program writes.
written() {
    local threads=$1 scene=$2 variant=$3 ending=$4
    shift 4
    wanted "$threads" "$scene" "$variant" || return 0
    rm -f result*
    RAYON_NUM_THREADS=$threads "$biscale" "$@" -o "result.$ending" > /dev/null 2>&1
    local rc=$?
    if [ $rc -eq 0 ] && [ "$ending" = json ]; then
        without_seconds < result.json > filtered.json && mv filtered.json result.json
        rc=$?
    fi
    line "$threads" "$scene" "$variant" $rc "result.$ending"
}

# values THREADS SCENE VARIANT ARGUMENTS...: what `eval` prints for the direction pairs.
values() {
    local threads=$1 scene=$2 variant=$3
    shift 3
    printed "$threads" "$scene" "$variant" cat eval "$scene" --pairs "$pairs" -o - --backend cpu --quiet "$@"
}

# reference SCENE VARIANT ARGUMENTS...: the reference with its standard errors. Two passes at every eighth pair limit its time.
reference() {
    local scene=$1 variant=$2
    shift 2
    awk 'NR % 8 == 1' "$pairs" > some_pairs.csv
    printed 2 "$scene" "$variant" cat eval "$scene" --pairs some_pairs.csv -o - --backend cpu --quiet \
        --quality reference --set quality.reference_samples=16 --standard-error "$@"
}

# Filters of standard output. The order of effects and the other keys of an effect are left out.
effects_on() {
    python3 -c '
import json, sys
for effect in sorted(json.load(sys.stdin)["effects"], key=lambda effect: effect["name"]):
    print(effect["name"], effect["on"])'
}
effects_with_reasons() {
    python3 -c '
import json, re, sys
for effect in sorted(json.load(sys.stdin)["effects"], key=lambda effect: effect["name"]):
    print(effect["name"], effect["on"], re.sub(r"[0-9.]+ ms", "_ ms", effect["reason"]))'
}
without_seconds() {
    python3 -c '
import json, sys
rows = json.load(sys.stdin)
for row in rows:
    row.pop("seconds", None)
print(json.dumps(rows, sort_keys=True))'
}

json_keys() {
    python3 -c '
import json, sys
def keys(value, path):
    for key, inner in value.items() if isinstance(value, dict) else []:
        print(path + key)
        keys(inner, path + key + ".")
    for inner in value if isinstance(value, list) else []:
        keys(inner, path + "[].")
keys(json.load(sys.stdin), "")'
}
csv_values() { grep -v '^#'; }

# Files that other outputs read: measured BRDFs in four formats and a mesh.
prepare() { "$biscale" "$@" --quiet > /dev/null 2>&1; }
prepare export fig5a_isotropic -o "$tmp/paint.binary" --quality draft --backend cpu
prepare export fig9b_cylinder_stripes -o "$tmp/paint.bsdf" --quality draft --backend cpu --resolution 9x8
prepare export fig9b_cylinder_stripes -o "$tmp/paint.bin" --quality draft --backend cpu
prepare export fig9b_cylinder_stripes -o "$tmp/paint.npz" --quality draft --backend cpu --resolution 12x12
prepare tile fig5d_pentagonal -o "$tmp/tile.obj"
brdf() { echo "material.default.brdf={ kind = \"$1\", path = \"$2\" }"; }

for threads in 1 2; do
    for scene in $scenes; do
        for quality in draft standard; do
            values $threads $scene $quality --quality $quality
        done
        printed $threads $scene plan effects_on plan $scene --json --quiet --backend cpu
        printed $threads $scene plan-reasons effects_with_reasons plan $scene --json --quiet --backend cpu
    done
    for scene in $six; do
        for quality in draft standard; do
            written $threads $scene render-$quality exr render $scene --quality $quality --size 96x96 --quiet --backend cpu
        done
    done
done

# The rest is made with two threads.
for scene in $six; do
    values 2 $scene fine --quality fine
    values 2 $scene interreflection --effect interreflection=on
done
for scene in fig1e_lambertian fig5b_anisotropic; do
    reference $scene reference
done
reference fig1e_lambertian reference-interreflection --effect interreflection=on
for scene in fig4c_ward_cup fig9a_cylinder_grooves; do
    values 2 $scene wu2011 --quality wu2011
done
written 2 table4_cup render-png png render table4_cup --quality draft --size 96x96 --quiet --backend cpu

# Other BRDFs, factors, other ways of visibility, meshes, and settings that are chosen.
merl=$(brdf merl "$tmp/paint.binary")
for quality in draft standard; do
    values 2 table4_teapot merl-$quality --quality $quality --set "$merl"
done
values 2 table4_teapot merl-low-rank --quality draft --set "$merl" --set quality.method=low_rank
values 2 table4_teapot low-rank --quality draft --set quality.method=low_rank
values 2 table4_teapot rgl --quality draft --set "$(brdf rgl "$tmp/paint.bsdf")"
values 2 table4_teapot utia --quality draft --set "$(brdf utia "$tmp/paint.bin")"
values 2 table4_teapot npz --quality draft --set "$(brdf npz "$tmp/paint.npz")"
values 2 table4_teapot blinn-phong --quality draft \
    --set 'material.default.brdf={ kind = "blinn_phong", exponent = 50, specular = 0.5 }'
values 2 table4_skirt maps --quality draft --set quality.visibility=maps
values 2 table4_cup slices --quality draft --set quality.visibility=slices
values 2 table4_plate normal-bins --quality draft --set quality.normal_bins=1000
values 2 table4_skirt mesh --quality draft --set "tile.geometry={ kind = \"mesh\", path = \"$tmp/tile.obj\" }"
written 2 default render-mesh exr render default --quality draft --size 96x96 --quiet --backend cpu \
    --set object.kind=mesh --set "object.path=\"$tmp/tile.obj\""
values 2 table4_cup target --target-db 35
printed 2 table3 basis without_seconds basis table3 --json --quiet --backend cpu

# Tables in every format.
for scene in fig5a_isotropic table4_cup; do
    for format in "npz 8x12" "csv 8x12" "exr 8x12" "bsdf 9x16" "astm 8x12"; do
        read -r ending resolution <<< "$format"
        written 2 $scene export-$ending $ending \
            export $scene --resolution $resolution --quality draft --quiet --backend cpu
    done
    for ending in binary xml bin; do
        written 2 $scene export-$ending $ending export $scene --quality draft --quiet --backend cpu
    done
    printed 2 $scene export-csv-values csv_values \
        export $scene -o - --resolution 8x12 --quality draft --quiet --backend cpu
done
written 2 fig9b_cylinder_stripes export-spec _spec.bsdf \
    export fig9b_cylinder_stripes --resolution 9x16 --quality draft --quiet --backend cpu
written 2 fig9b_cylinder_stripes export-tensor-tree xml \
    export fig9b_cylinder_stripes --radiance tensor-tree --quality draft --quiet --backend cpu

# The tile itself, and fits.
for scene in table4_cup fig5d_pentagonal; do
    for ending in obj stl png svg pdf; do
        written 2 $scene tile-$ending $ending tile $scene --quiet
    done
done
for scene in table4_cup fig7a_shot_silk; do
    for ending in json gltf mtlx; do
        written 2 $scene fit-$ending $ending fit $scene --quality draft --quiet --backend cpu
    done
done

# Keys of JSON in the order in which they are printed, which include the names of stages.
for edit in geometry brdf color camera; do
    printed 2 table4_cup profile-$edit-keys json_keys \
        profile table4_cup --edit $edit --repeat 1 --size 64x64 --quality draft --json --quiet --backend cpu
done
printed 2 table4_cup render-keys json_keys \
    render table4_cup -o keys.exr --size 64x64 --quality draft --json --quiet --backend cpu
printed 2 table4_cup eval-keys json_keys \
    eval table4_cup --pairs "$pairs" -o keys.csv --quality draft --json --quiet --backend cpu
printed 2 table4_cup export-keys json_keys \
    export table4_cup -o keys.csv --resolution 8x12 --quality draft --json --quiet --backend cpu
printed 2 - materials-keys json_keys materials --json
for method in dual faces truth; do
    written 2 slab_fig3_both transmit-$method csv transmit slab_fig3_both --method $method --quiet
done
written 2 slab_two_tiles slab xml export slab_two_tiles --quality draft --quiet

# Exit codes of wrong usage and of bad input.
values 2 no_such_scene unknown-scene
values 2 default unknown-key --set tile.geometry.dept=0.3
values 2 default unknown-effect --effect no_such_effect=on
written 2 default unknown-ending xyz export default --quiet
written 2 default no-folder no/such/folder.csv export default --resolution 8x12 --quality draft --quiet --backend cpu
