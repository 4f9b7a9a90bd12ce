#!/usr/bin/env bash
# Makes castfem's environment ready, in the checkout's .castfem folder.
#
#   tools/env.sh [ready]     all of it; nothing to do in a blink when it is there
#   tools/env.sh ruff        the linter too, at the version pyproject.toml pins
#   tools/env.sh optimise    Optuna too, for castfem optimise (pyproject.toml, extra "optimise")
#   tools/env.sh calphad     pycalphad too, for steels by a database (pyproject.toml, extra "calphad")
#   tools/env.sh benchmark   the benchmarks' opponent too (pyproject.toml, extra "benchmark")
#   tools/env.sh browser     what drives a browser in tests (pyproject.toml, extra "browser")
#   tools/env.sh paraview    VTK, whose readers are ParaView's (pyproject.toml, extra "paraview")
#   tools/env.sh wheel       what builds wheels (pyproject.toml, extra "wheel")
#   tools/env.sh docs        what makes the manual too (tools/docs_packages.txt), in .castfem/docs
#   tools/env.sh packages    print Debian's names of what castfem needs ("packages docs": the manual)
#   tools/env.sh clean       remove the environments of this checkout and the shared userlands
#
#   tools/env.sh choice      print which of the following would be taken, and of which Python
#
# DOLFINx 0.9 ... 0.11 comes from the first of these that there is; SOLVER names one, whose environment
# then lies beside the ordinary one, in .castfem/$SOLVER:
#
#   system   a Python that has it ($PYTHON, python3, /usr/bin/python3), as it is, below a venv
#   wheel    PyPI, in a venv of a Python >= 3.12 ($PYTHON, python3, python3.14 ... 3.12; if it is named,
#            those of pyenv)
#   debian   a private Debian userland in the user's cache folder, built once for all checkouts;
#            DEBIAN=<suite> asks for the userland of that suite, in .castfem/$DEBIAN

set -Eeuo pipefail
umask 022

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)
cd "$root"
tools=$root/tools
suite=${DEBIAN:-}
solver=${SOLVER:-${suite:+debian}}
home=$root/.castfem/${suite:-${SOLVER:-}}
home=${home%/}
HOME=${HOME:-$(getent passwd "$EUID" | cut -d: -f6)}
cache=${XDG_CACHE_HOME:-$HOME/.cache}/castfem

say() { printf 'castfem: %s\n' "$*" >&2; }

die() {
  printf 'castfem: error: %s\n' "$*" >&2
  exit 1
}

# The last resort, where nothing better was said.
stopped() {
  [[ $(df -Pk "$root" | awk 'NR == 2 { print $4 }') -gt 1024 ]] ||
    die "the disk is full: free some space, then run it again"
  die "stopped at line $1 of $2; run it again, after \`make clean-env\` if need be"
}
trap 'stopped "$LINENO" "${BASH_SOURCE[0]}"' ERR
trap 'die "interrupted; run it again to start afresh"' INT TERM HUP

# The names in tools/packages.txt, or with $1 those in its list, as tools/docs_packages.txt.
packages() {
  sed 's/#.*//' "$tools/${1:+$1_}packages.txt" | tr -s '[:space:]' '\n' | sed '/^$/d'
}

digest() { sha256sum | cut -c "1-$1"; }

# What the environment was made from: any change here makes it anew.
recipe() {
  cat "$root/pyproject.toml" "$tools"/{env.sh,userland.sh,install.py,packages.txt}
  printf '%s\n' "$root" "$cache" "$suite" "${SOLVER:-}"
}

# shellcheck source=tools/userland.sh
. "$tools/userland.sh"

# Holds the lock file $1 until this process ends, so that two set-ups at once are safe.
lock() {
  mkdir -p "${1%/*}" || die "cannot write in ${1%/*}: free some space or mend its permissions"
  { exec {lock_fd}>"$1"; } 2>/dev/null || die "cannot write $1: is the disk full or read-only?"
  flock -n "$lock_fd" || {
    say "another set-up is at work; waiting for it"
    flock "$lock_fd"
  }
}

# Looks among "${@:2}" for a Python that tools/probe.py finds good for $1, system or wheel, and sets
# what that prints. What is said of others is kept in passed_over.
find_python() {
  local candidate verdict seen=' ' what=()
  [[ $1 == system ]] || what=("$1")
  for candidate in "${@:2}"; do
    candidate=$(command -v "${candidate:-/nowhere}") || continue
    [[ $seen == *" $candidate "* ]] && continue
    seen+="$candidate "
    if verdict=$(timeout 120 "$candidate" "$tools/probe.py" "${what[@]}" 2>/dev/null); then
      eval "$(grep -E '^(python|dolfinx|parent|missing|wheels)=' <<<"$verdict")"
      return 0
    fi
    verdict="$candidate is passed over: ${verdict:-no answer}"
    passed_over+="; $verdict"
    [[ $1 == wheel || $candidate != "${PYTHON:-}" && $verdict == *': no DOLFINx (No module'* ]] ||
      say "$verdict"
  done
  return 1
}

# Sets solver to the first that there is, unless it is given, and what tools/probe.py prints.
choose() {
  local asked=$solver passed_over='' more=()
  python='' dolfinx='' parent='' missing='' wheels=''
  case ${asked:-any} in any | system | wheel | debian) ;; *)
    die "SOLVER=$asked is unknown: choose system, wheel or debian; see the head of tools/env.sh"
    ;;
  esac
  [[ -z $suite || $asked == debian ]] || die "DEBIAN=$suite and SOLVER=$asked exclude each other"
  if [[ -z $asked || $asked == system ]]; then
    solver=system
    find_python system "${PYTHON:-}" python3 /usr/bin/python3 && return
  fi
  if [[ -z $asked || $asked == wheel ]]; then
    solver=wheel
    [[ -z $asked ]] || more=("${PYENV_ROOT:-$HOME/.pyenv}"/versions/3.*/bin/python3)
    find_python wheel "${PYTHON:-}" python3 python3.1{4,3,2} "${more[@]}" && return
  fi
  [[ -z $asked || $asked == debian ]] ||
    die "SOLVER=$asked: there is no Python for it$passed_over"
  solver=debian python=/usr/bin/python3
}

choice() {
  choose
  printf '%s %s\n' "$solver" "$python"
}

# Runs a program of the environment that is being made.
inside() { "$tools/enter.sh" "$home" "$@"; }

# Runs the command "${@:2}" silently; if it fails, says $1 with the last line of what it wrote.
quietly() {
  local words
  local offline='Failed to establish|Temporary failure|onnectionError|ProxyError|o matching dist'
  words=$("${@:2}" 2>&1) && return
  [[ $words =~ 'No space left' ]] && die "the disk is full: free some space, then run it again"
  [[ $words =~ $offline ]] && die "$1: PyPI cannot be reached;" \
    "mend the network (or PIP_INDEX_URL, https_proxy), then run it again"
  die "$1: $(tail -n 1 <<<"$words")"
}

# The venv: castfem itself, editable, and whatever pure-Python parts the machine lacks.
make_venv() {
  local script folder words
  [[ $solver == wheel ]] || {
    rm -rf "$home/venv"
    quietly "cannot make $home/venv" inside "$python" -m venv --system-site-packages --without-pip \
      "$home/venv"
  }
  if [[ -n $parent ]]; then
    folder=("$home"/venv/lib/python3*/site-packages)
    tr ':' '\n' <<<"$parent" |
      sed "s/.*/import site; site.addsitedir('&')/" >"${folder[0]}/parent.pth"
  fi
  if [[ -n $missing ]]; then
    say "from PyPI: $missing"
    # shellcheck disable=SC2086
    quietly "cannot install $missing" inside "$home/venv/bin/python" -m pip install -q $missing
    words=$(inside "$home/venv/bin/python" "$tools/probe.py" 2>/dev/null) ||
      die "with PyPI's wheels, $words; install what is missing from where DOLFINx came from" \
        "(Debian: apt-get install \$(tools/env.sh packages); conda: environment.yml)"
  fi
  quietly 'cannot install castfem' inside "$home/venv/bin/python" "$tools/install.py"
  for script in castfem python mpirun; do
    printf '#!/usr/bin/env bash\nexec %q %q %s "$@"\n' "$tools/enter.sh" "$home" "$script" \
      >"$home/bin/$script"
    chmod +x "$home/bin/$script"
  done
}

# Whether what is there was made from the same recipe and its Python still runs.
is_ready() {
  [[ -f $home/ready && $(<"$home/ready") == "$(recipe | digest 64)" ]] || return 1
  # shellcheck source=/dev/null
  . "$home/env.conf"
  [[ -z ${PYTHON:-} || -n $suite || $(command -v "$PYTHON") == "$asked" ]] || return 1
  case $kind in
    host) "$home/venv/bin/python" -c '' 2>/dev/null ;;
    *) [[ -f $userland/castfem-ready ]] && command -v bwrap >/dev/null ;;
  esac
}

# A venv with the wheels of DOLFINx; the rest is missing then. Status 1, said why, if it cannot be.
make_wheel_venv() {
  local words
  rm -rf "$home/venv"
  say "from PyPI, for $python: $wheels (0.4 GB to fetch, 1.1 GB kept)"
  # shellcheck disable=SC2086
  if words=$("$python" -m venv "$home/venv" 2>&1) &&
    words=$("$home/venv/bin/python" -m pip install -q --disable-pip-version-check $wheels 2>&1) &&
    words=$("$home/venv/bin/python" "$tools/probe.py" 2>&1); then
    eval "$(grep -E '^(dolfinx|missing)=' <<<"$words")"
    return
  fi
  say "they cannot be had: ${words##*$'\n'}"
  return 1
}

ready() {
  local name kind=host userland='' python dolfinx parent missing wheels asked given=$solver
  is_ready && return
  lock "$home/lock"
  is_ready && return # somebody else made it meanwhile
  rm -f "$home/ready"
  choose
  if [[ $solver == wheel ]] && ! make_wheel_venv; then
    [[ -z $given ]] || exit 1
    solver=debian python=/usr/bin/python3
  fi
  if [[ $solver == debian ]]; then
    kind=userland
    userland=$(userland_path "${suite:-trixie}")
    build_userland "${suite:-trixie}" "$userland"
    dolfinx=$(<"$userland/castfem-ready")
  fi
  mkdir -p "$home/bin"
  asked=$(command -v "${PYTHON:-/nowhere}") || asked=''
  for name in kind userland python dolfinx asked; do
    printf '%s=%q\n' "$name" "${!name}"
  done >"$home/env.conf"
  make_venv
  inside mpirun --version 2>/dev/null |
    sed -n 's/.*(Open MPI) \([0-9]*\).*/openmpi=\1/p' >>"$home/env.conf" || true
  recipe | digest 64 >"$home/ready"
  say "ready: DOLFINx $dolfinx of ${userland:-$python}; programs in $home/bin"
}

# Links ruff into the venv, from one shared copy for all checkouts.
ruff() {
  local pin folder
  pin=$(sed -n 's/.*"ruff==\([0-9.]*\)".*/\1/p' "$root/pyproject.toml")
  folder=$cache/ruff-$pin-$(uname -m)
  if [[ ! -x $folder/bin/ruff ]]; then
    lock "$cache/ruff.lock"
    rm -rf "$folder".tmp.*
    quietly "cannot install ruff $pin" inside python -m pip install -q --disable-pip-version-check \
      --target "$folder.tmp.$$" "ruff==$pin"
    rm -rf "$folder"
    mv "$folder.tmp.$$" "$folder"
  fi
  ln -sfn "$folder/bin/ruff" "$home/venv/bin/ruff"
}

# Installs the extra $1 into the venv; castfem itself is there already.
extra() {
  quietly "cannot install the extra \"$1\"" inside python -m pip install -q \
    --disable-pip-version-check "castfem[$1]"
}

# The manual's tools: in the userland a copy of it with Debian's packages, the venv otherwise. The
# folder $home/docs is an environment for tools/enter.sh, with the same venv.
docs() {
  local tools_of="import sphinx, myst_parser, pydata_sphinx_theme" kind userland
  # shellcheck source=/dev/null
  . "$home/env.conf"
  mkdir -p "$home/docs"
  ln -sfn ../venv "$home/docs/venv"
  cp "$home/env.conf" "$home/docs/env.conf"
  if [[ $kind == userland ]]; then
    add_packages "$userland" "$(docs_userland "$userland")"
    printf 'userland=%q\n' "$(docs_userland "$userland")" >>"$home/docs/env.conf"
  elif ! inside python -c "$tools_of" 2>/dev/null; then
    say 'from PyPI: the extra "docs"'
    extra docs
  fi
}

clean() {
  local gone
  for gone in "$home" "$cache/userland-$suite"* "$cache"/ruff[-.]*; do
    [[ -e $gone && ! (-n $suite && $gone == */ruff*) ]] || continue
    [[ -z ${SOLVER:-} || $gone == "$home" ]] || continue
    say "removing $gone"
    discard "$gone"
  done
}

case ${1:-ready} in
  ready) ready ;;
  ruff | docs)
    ready
    "$1"
    ;;
  benchmark | browser | calphad | optimise | paraview | wheel)
    ready
    extra "$1"
    ;;
  choice | packages | clean) "$1" "${2:-}" ;;
  *) die "unknown: $1; see the head of tools/env.sh" ;;
esac
