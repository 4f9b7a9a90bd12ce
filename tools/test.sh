#!/usr/bin/env bash
# Checks castfem inside the environment HOME: lint, types, the parallel tests on two ranks, those that
# depend on the version of DOLFINx on that of PyPI (if its environment, .castfem/wheel, is there and
# no tests are chosen), then all others on one rank each, spread over the cores, last, so that
# pytest's count closes the output. Status 0 only if all passed.
#
#   tools/test.sh HOME all [PYTEST ARGUMENT ...]
#   tools/test.sh HOME lint

set -u
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 1
home=$PWD/$1
what=$2
shift 2
colour=no # mpirun would make pytest believe in a terminal
[[ -t 1 ]] && colour=yes
summary=()
failed=()
two_ranks=none # or run: whether there were tests for them
# Hundreds of forms are compiled, each used for seconds: -O1 compiles large kernels in half the time,
# and to the same bits; runs of users, whose matrices it would assemble a sixth slower, have -O2.
export XDG_CONFIG_HOME=$home/config
unset PYTHONDONTWRITEBYTECODE # hundreds of processes would each translate all modules anew

inside() { tools/enter.sh "$home" "$@"; }

# What can differ between versions of DOLFINx, PETSc, HDF5 and MPI: forms, files, ranks, commands.
OTHER_VERSION=(tests/fem tests/output tests/cli/test_cli_run.py tests/runs/test_run_on_ranks.py)

# Runs the step named $1 and notes how it went.
step() {
  local name=$1 start=$SECONDS verdict=passed
  shift
  printf '== %s\n' "$name"
  "$@" || {
    verdict="FAILED (status $?)"
    failed+=("$name")
  }
  summary+=("$(printf '   %-23s %s in %d s' "$name" "$verdict" $((SECONDS - start)))")
}

# The tests marked mpi on two ranks. Rank 0 speaks; the other is heard if something fails. The limit
# ends a deadlock, which is how a failure on one rank alone shows.
pytest_on_two_ranks() {
  local log=$home/pytest-rank1.log status=0 files=()
  # Both ranks would import all test files for the few that hold such tests.
  [[ $# -gt 0 ]] || mapfile -t files < <(grep -rl --include='test_*.py' 'mark\.mpi' tests | sort)
  # shellcheck disable=SC2016
  inside timeout --kill-after=10 1200 mpirun -n 2 bash -c '
    rank=${OMPI_COMM_WORLD_RANK:-${PMI_RANK:-0}}
    if [[ $rank != 0 ]]; then exec >"$1" 2>&1; fi
    shift
    exec python -m pytest -m mpi -p no:cacheprovider "$@"' bash "$log" --color="$colour" \
    "${files[@]}" "$@" || status=$?
  [[ $status -ne 5 || $# -eq 0 ]] || return 0 # the user's choice of tests holds none of these
  two_ranks=run
  if [[ $status -ne 0 ]]; then
    printf -- '-- the other rank, last lines\n'
    tail -n 40 "$log"
  fi
  return "$status"
}

# What mypy, begun beside the tests on two ranks, has found.
told_by_mypy() {
  local status=0
  wait "$types" || status=$?
  cat "$home/mypy.log"
  return "$status"
}

# Whether there is an environment with the DOLFINx of PyPI, and this one has another.
has_other_version() {
  [[ -f $PWD/.castfem/wheel/ready ]] || return 1
  [[ $(sed -n 's/^dolfinx=//p' "$PWD/.castfem/wheel/env.conf") != "$dolfinx"* ]]
}

pytest_on_other_version() {
  tools/enter.sh "$PWD/.castfem/wheel" python -m pytest -q --dist worksteal \
    -n "$(env -u OMP_NUM_THREADS nproc)" -p no:cacheprovider "${OTHER_VERSION[@]}"
}

# All others, spread over the cores.
pytest_on_one_rank() {
  local cores status=0
  cores=$(env -u OMP_NUM_THREADS nproc)
  inside python -m pytest -n "$cores" --dist worksteal -m 'not mpi' "$@" || status=$?
  # The user's choice of tests may hold those for two ranks alone.
  [[ $status -eq 0 || ($status -eq 5 && $two_ranks == run) ]]
}

mkdir -p "$XDG_CONFIG_HOME/dolfinx"
printf '{"cffi_extra_compile_args": ["-O1", "-g0"]}\n' >"$XDG_CONFIG_HOME/dolfinx/dolfinx_jit_options.json"

step 'ruff check' inside ruff check --quiet --output-format concise .
step 'ruff format' inside ruff format --check --quiet --output-format concise .
# Later DOLFINx are annotated otherwise: one set of types can satisfy one of them alone.
dolfinx=$(inside python -c 'import dolfinx; print(dolfinx.__version__)')
types=
if [[ $dolfinx == 0.9.* ]]; then
  # What it knows of libraries is the same for all checkouts.
  inside python -m mypy --cache-dir "${XDG_CACHE_HOME:-$HOME/.cache}/castfem/mypy" \
    >"$home/mypy.log" 2>&1 & # on the core that is free
  types=$!
else
  summary+=("   mypy                    left out: the types are those of DOLFINx 0.9, not $dolfinx")
fi
if [[ $what == all ]]; then
  step 'pytest, 2 ranks' pytest_on_two_ranks "$@"
fi
[[ -z $types ]] || step 'mypy' told_by_mypy
if [[ $what == all && $# -eq 0 && $home == */.castfem ]]; then
  if has_other_version; then
    step 'pytest, DOLFINx of PyPI' pytest_on_other_version
  else
    summary+=("   pytest, DOLFINx of PyPI left out: no Python for it, or the same version")
  fi
fi
printf '== summary so far\n'
printf '%s\n' "${summary[@]}"
if [[ $what == all ]]; then
  step 'pytest, 1 rank' pytest_on_one_rank "$@"
fi
if [[ ${#failed[@]} -gt 0 ]]; then
  printf '== FAILED:'
  printf ' [%s]' "${failed[@]}"
  printf '\n'
  exit 1
fi
