# The private Debian userland: read by tools/env.sh, which has set root, tools and cache.
# shellcheck shell=bash disable=SC2154

userland_version=2 # to be raised with any change here that makes another tree
userland_room=5    # GB that must be free: the tree, and the packages while they are unpacked

# Where the userland of suite $1 lies: its name changes with the package list and the version.
userland_path() {
  local key
  key=$({ packages && echo "$userland_version $(uname -m)"; } | digest 12)
  printf '%s/userland-%s-%s\n' "$cache" "$1" "$key"
}

# What the user can do instead of a userland.
other_way="or bring a Python with DOLFINx (conda env create -f environment.yml) and run it again"

# Makes sure of the host's tools; installs them as root, asks for them otherwise.
need_tools() {
  local tool wanted=() names words
  for tool in mmdebstrap bwrap; do
    command -v "$tool" >/dev/null || wanted+=("${tool/bwrap/bubblewrap}")
  done
  [[ $EUID -eq 0 ]] || command -v newuidmap >/dev/null || wanted+=(uidmap)
  if [[ ${#wanted[@]} -gt 0 ]]; then
    names=${wanted[*]}
    [[ $EUID -eq 0 ]] ||
      die "missing: $names; have an administrator run \`apt-get install $names\`, $other_way"
    command -v apt-get >/dev/null ||
      die "missing: $names; install them with your distribution's tool, $other_way"
    say "installing $names"
    {
      apt-get update -qq && apt-get install -qq --no-install-recommends -o DPkg::Lock::Timeout=300 \
        "${wanted[@]}" debian-archive-keyring
    } >"$log" 2>&1 </dev/null || explain "cannot install $names"
  fi
  words=$(bwrap --ro-bind / / true 2>&1) ||
    die "bubblewrap cannot make namespaces here (${words##*$'\n'}); allow them (sysctl" \
      "user.max_user_namespaces, kernel.unprivileged_userns_clone; docker run --privileged)," \
      "$other_way"
  words=$("${as_root[@]}" true 2>&1) ||
    die "no user namespace with subordinate ids (${words##*$'\n'}); have an administrator run" \
      "\`usermod --add-subuids 100000-165535 --add-subgids 100000-165535 $(id -un)\`, $other_way"
}

# Ends with the cause found in the log and its mend; $1 says what failed.
explain() {
  local again="then run it again"
  local offline='Could not (resolve|connect|handshake)|Temporary failure|Unable to connect|'
  offline+='Connection (timed|refused|failed)|Network is unreachable|Failed to fetch'
  sleep 0.2 # the log's writer may be a moment behind
  if [[ $(free_space) == 0.0 ]] || grep -Eq 'No space left|enough free space' "$log"; then
    die "$1: the disk is full; free $userland_room GB below $cache (or set XDG_CACHE_HOME), $again"
  elif grep -Eq "$offline" "$log"; then
    die "$1: Debian's mirror cannot be reached; mend the network (or http_proxy), $again"
  fi
  die "$1: $(grep -E '^E: |error' "$log" | tail -n 1); the whole log is $log"
}

# GB free where the userlands lie.
free_space() { df -Pk "$cache" | awk 'NR == 2 { printf "%.1f", $4 / 1048576 }'; }

need_room() {
  local free
  free=$(free_space)
  awk "BEGIN { exit !($free < $userland_room) }" || return 0
  die "$cache has $free GB free and a userland needs $userland_room;" \
    "free some space, or set XDG_CACHE_HOME to a folder on a larger disk"
}

# Makes an ordinary user root of a namespace whose other users are the subordinate ids.
as_root=(unshare)
[[ $EUID -eq 0 ]] || as_root+=(--user --map-root-user --map-auto)

# Removes trees of the userland, which may hold files of those other users.
discard() { "${as_root[@]}" rm -rf --one-file-system "$@" 2>/dev/null || rm -rf "$@"; }

# Fills `bootstrap` with the command that makes a userland of suite $1 in folder $2. Its processes
# and mounts end when this script does, however that happens.
#
# Python's modules are translated at the end on all cores: each package would start Python for its
# own, which takes as long as all the unpacking. What castfem never opens stays out of the tree.
bootstrap_command() {
  local proxy translate=/usr/bin/py3compile left_out
  bootstrap=(
    setpriv --pdeathsig KILL "${as_root[@]}" --mount --pid --fork --kill-child --mount-proc
    mmdebstrap --mode=root --format=directory --variant=minbase
    --include="$(packages | paste -sd,)"
    --aptopt='APT::Install-Recommends "false"' --aptopt='Acquire::Retries "3"'
    --aptopt='Acquire::Check-Valid-Until "false"' --dpkgopt=force-unsafe-io
    --dpkgopt='path-exclude=/usr/share/man/*' --dpkgopt='path-exclude=/usr/share/doc/*'
    --dpkgopt='path-include=/usr/share/doc/*/copyright'
    --dpkgopt='path-exclude=/usr/share/locale/*/LC_MESSAGES/*'
    --essential-hook="chroot \"\$1\" dpkg-divert --quiet --local --rename --add $translate"
    --essential-hook="ln -s true \"\$1\"$translate"
    --customize-hook="rm \"\$1\"$translate"
    --customize-hook="chroot \"\$1\" dpkg-divert --quiet --local --rename --remove $translate"
    --customize-hook='chroot "$1" python3 -m compileall -q -j 0 -x "/tests?/" /usr/lib/python3 \
      /usr/lib/petscdir /usr/lib/slepcdir >/dev/null'
  )
  for left_out in '/usr/include/boost/*' '/usr/libexec/valgrind/*' '/usr/lib/debug/*' \
    '/usr/share/unicode/*' '/usr/share/cmake-*'; do
    bootstrap+=(--dpkgopt="path-exclude=$left_out")
  done
  proxy=$(apt_proxy)
  [[ -z $proxy ]] || bootstrap+=(--aptopt="Acquire::http::Proxy \"$proxy\"")
  bootstrap+=("$1" "$2")
}

# Builds the userland of suite $1 as $2 unless it is there: beside it first, renamed when complete.
build_userland() {
  local bootstrap log=$2.log part=$2.part version
  if [[ ! -f $2/castfem-ready ]]; then
    lock "$2.lock"
  fi
  if [[ -f $2/castfem-ready ]]; then
    command -v bwrap >/dev/null || need_tools
    return 0
  fi
  : >"$log" || die "cannot write $log: is the disk full or read-only?"
  need_tools
  discard "$2" "$part" # what an interrupted set-up left
  need_room
  bootstrap_command "$1" "$part"
  say "building a Debian $1 userland with DOLFINx, once: 0.7 GB to fetch, 2.4 GB kept, 2 minutes"
  # shellcheck disable=SC2064
  trap "discard $(printf %q "$part")" EXIT
  mkdir -p "$part"
  "${bootstrap[@]}" >/dev/null 2> >(progress) || explain 'cannot build the userland'
  version=$(finish "$part" 2>>"$log") || explain 'the new userland does not work'
  printf '%s\n' "$version" >"$part/castfem-ready"
  sync -f "$part"
  mv "$part" "$2"
  trap - EXIT
  rm -f "$log"
}

# Where the copy of the userland $1 lies that makes the manual.
docs_userland() { printf '%s-docs-%s\n' "$1" "$(packages docs | digest 12)"; }

# Makes $2 of the userland $1: its files as links, beside them those of the manual's packages and of
# what these need. Unpacked and not configured: Python needs no more. No right of root is needed.
add_packages() {
  local log=$2.log part=$2.part apt
  [[ ! -f $2/castfem-ready ]] || return 0
  lock "$2.lock"
  [[ ! -f $2/castfem-ready ]] || return 0
  : >"$log" || die "cannot write $log: is the disk full or read-only?"
  say "adding what makes the manual to a copy of the userland, once: 12 MB to fetch, 80 MB kept"
  # shellcheck disable=SC2064
  trap "discard $(printf %q "$part") $(printf %q "$part.apt")" EXIT
  discard "$2" "$part" "$part.apt"
  cp -al "$1" "$part" 2>>"$log" || explain 'cannot copy the userland'
  mkdir -p "$part.apt"/{lists/partial,archives/partial}
  # shellcheck disable=SC2054
  apt=(apt-get -qq -y --no-install-recommends --download-only -o Acquire::Retries=3
    -o Acquire::Check-Valid-Until=false -o Debug::NoLocking=1 -o APT::Sandbox::User=
    -o Dir::State="$part.apt" -o Dir::State::status="$1/var/lib/dpkg/status" -o Dir::Cache="$part.apt"
    -o Acquire::http::Proxy="$(apt_proxy)")
  {
    "$tools/enter.sh" --userland "$1" "${apt[@]}" update &&
      # shellcheck disable=SC2046
      "$tools/enter.sh" --userland "$1" "${apt[@]}" install $(packages docs) &&
      # shellcheck disable=SC2016
      "$tools/enter.sh" --userland "$1" sh -ec 'cd "$1"; for deb in *.deb; do
        dpkg-deb --fsys-tarfile "$deb" | tar -x --no-same-owner -C "$2" \
          --exclude=./usr/share/man --exclude=./usr/share/doc; done' \
        sh "$part.apt/archives" "$part"
  } >>"$log" 2>&1 || explain "cannot add the manual's tools"
  "$tools/enter.sh" --userland "$part" python3 -c 'import sphinx, myst_parser, pydata_sphinx_theme' \
    2>>"$log" || explain "the manual's tools do not work"
  mv "$part" "$2"
  discard "$part.apt"
  trap - EXIT
  rm -f "$log"
}

# The host's proxy for apt, if it has one.
apt_proxy() {
  apt-config dump Acquire::http::Proxy 2>/dev/null |
    sed -n 's/^Acquire::http::Proxy "\(.*\)";/\1/p' || true
}

# Keeps the log and shows its main lines.
progress() {
  tee "$log" 2>/dev/null | sed -un '/signal/d; s/^I: .*compileall.*/I: translating modules.../
    /-hook/d; s/^I: \(.*ing .*\)/castfem:   \1/p' >&2 || true
}

# Prepares the tree $1 for bubblewrap and prints the version of DOLFINx that answers in it.
finish() {
  local name
  rm -f "$1"/etc/{resolv.conf,hostname,hosts,localtime,apt/apt.conf.d/99mmdebstrap}
  cp "$1/usr/share/zoneinfo/UTC" "$1/etc/localtime"
  for name in resolv.conf hostname hosts pip.conf; do
    : >"$1/etc/$name" # where enter.sh binds the host's
  done
  [[ $EUID -eq 0 ]] || "${as_root[@]}" chown -hR 0:0 "$1" # every file the user's own
  "$tools/enter.sh" --userland "$1" \
    python3 -c 'import dolfinx, gmsh, h5py; print(dolfinx.__version__)'
}
