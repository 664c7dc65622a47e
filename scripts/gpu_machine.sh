#!/usr/bin/env bash
# Run GPU benchmarks on a machine without a network: `scripts/gpu_machine.sh COMMAND`.
#
#   prepare   on a machine with a network: put wheels, Warp's library and compiled kernels into the
#             folders .gpu1 and .gpu2, each below 60 MB; takes fifteen minutes of two cores
#   install   on the GPU machine, which needs the repository and both folders, at once or one after
#             the other: unpack them into /tmp/gpu; takes half a minute
#   run       on the GPU machine: run `python -m benchmarks.run gpu`, or the suites that are named
#             after `run`, and write the results to $OUT; takes two minutes
#
# The GPU machine needs x86-64 Linux, an NVIDIA driver, Python 3.12, NumPy, SciPy and PyTorch (CUDA).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

ours=.venv/bin/python
there=/tmp/gpu
packages=(
    farama-notifications glfw gymnasium importlib-metadata markdown-it-py mdurl msgspec mujoco
    mujoco-core mujoco-warp orjson pygments pyvers rich rsl-rl-lib sb3-contrib stable-baselines3
    tensordict warp-lang
)

prepare() {
    local work wheels=()
    work=$(mktemp -d)
    rm -rf .gpu1 .gpu2
    mkdir .gpu1 .gpu2
    for glibc in 39 35 34 31 28 27 24 17; do
        wheels+=(--platform "manylinux_2_${glibc}_x86_64")
    done
    "$ours" -m pip download --quiet --no-deps --only-binary=:all: -c constraints.txt \
        --python-version 3.12 --implementation cp "${wheels[@]}" --platform manylinux2014_x86_64 \
        --platform manylinux1_x86_64 -d "$work" "${packages[@]}"
    # Warp without its compiler for CPUs, and its library as small as xz makes it.
    mkdir "$work/warp"
    unzip -q "$work"/warp_lang-*.whl -d "$work/warp" -x 'warp/examples/*' 'warp/tests/*' \
        'warp/bin/warp-clang.so'
    rm "$work"/warp_lang-*.whl
    # Our own package runs from `src`, but its version is read from this folder.
    cp -r .venv/lib/python3*/site-packages/shapechanger-*.dist-info "$work/warp/"
    sha256sum <"$work/warp/warp/bin/warp.so" | cut -d' ' -f1 >.gpu2/warp.so.sha256
    nice xz -c --x86 --lzma2="preset=${XZ_PRESET:-9e},dict=192MiB" "$work/warp/warp/bin/warp.so" |
        split -b 44M -d - "$work/warp.so.xz."
    rm "$work/warp/warp/bin/warp.so"
    mv "$work/warp.so.xz.00" .gpu1/
    mv "$work"/warp.so.xz.* "$work"/*.whl .gpu2/
    tar -C "$work/warp" -cJf .gpu2/warp.tar.xz .
    "$ours" -W ignore -m benchmarks.gpu .gpu2/reference.npz
    WARP_CACHE_PATH=$work/kernels "$ours" -W ignore -m benchmarks.gpu_kernels
    (cd "$work/kernels" && find . -name '*.cubin' -o -name '*.meta') |
        tar -C "$work/kernels" -cJf .gpu2/kernels.tar.xz -T -
    rm -rf "$work"
    du -sm .gpu1 .gpu2
}

install() {
    mkdir -p "$there/parts" "$there/site/warp/bin" "$there/kernels"
    for part in .gpu1 .gpu2; do
        if [ -d "$part" ]; then cp -n "$part"/* "$there/parts/"; fi
    done
    [ -e "$there/parts/warp.so.sha256" ] || return 0 # The second folder comes later.
    [ -e "$there/installed" ] && return 0
    python3 -m pip install --quiet --no-index --no-deps --no-compile --target "$there/site" \
        "$there"/parts/*.whl
    tar -C "$there/site" -xJf "$there/parts/warp.tar.xz"
    cat "$there"/parts/warp.so.xz.* | python3 -c 'import lzma, shutil, sys
shutil.copyfileobj(lzma.open(sys.stdin.buffer), sys.stdout.buffer)' >"$there/site/warp/bin/warp.so"
    [ "$(sha256sum <"$there/site/warp/bin/warp.so" | cut -d' ' -f1)" = \
        "$(cat "$there/parts/warp.so.sha256")" ] || { echo "warp.so is broken." >&2; return 1; }
    tar -C "$there/kernels" -xJf "$there/parts/kernels.tar.xz"
    touch "$there/installed"
}

run() {
    local out=${OUT:-/tmp/gpu/out}
    mkdir -p "$out"
    nvidia-smi --query-gpu=name,driver_version,memory.used,clocks.sm --format=csv,noheader
    export PYTHONPATH=$PWD/src:$there/site:$PWD WARP_CACHE_PATH=$there/kernels
    export GPU_REFERENCE=$there/parts/reference.npz PYTHONUNBUFFERED=1 OMP_NUM_THREADS=8
    local status=0
    python3 -W ignore -m benchmarks.run "${@:-gpu}" 2>&1 | tee "$out/log.txt" || status=$?
    cp benchmarks/results/{gpu*.json,generalist-gpu.safetensors} "$out/"
    return "$status"
}

case ${1:-} in
    prepare | install | run) "$@" ;;
    *)
        sed -n '2,/^set/{/^set/d;s/^# \{0,1\}//;p}' "$0"
        exit 2
        ;;
esac
