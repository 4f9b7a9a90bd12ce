#!/usr/bin/env bash
# Runs a program inside castfem's environment, wherever that came from (tools/env.sh decides).
#
#   tools/enter.sh HOME PROGRAM [ARGUMENT ...]             HOME: the environment's folder, .castfem
#   tools/enter.sh --userland DIR PROGRAM [ARGUMENT ...]   a bare userland, before HOME exists
#
# Paths inside equal paths outside: of the host only /usr (but not /usr/local and /usr/src), /etc
# and /boot are hidden by the userland. Exit status, streams, signals and variables pass through.

set -u

die() {
  printf 'castfem: error: %s\n' "$*" >&2
  exit 125
}

# Sets variable $1 to $2 unless the user has.
default() { [[ -n ${!1:-} ]] || export "$1=$2"; }

# What suits one machine with few cores.
set_defaults() {
  default OMP_NUM_THREADS 1 # BLAS threads fight with MPI ranks
  case $openmpi in          # more ranks than cores: each version has its own word for it
    [1-4]) default OMPI_MCA_rmaps_base_oversubscribe 1 ;;
    5) default PRTE_MCA_rmaps_default_mapping_policy :oversubscribe ;;
    ?*) default PRTE_MCA_mapby :oversubscribe ;;
  esac
  # Outside a batch job there is one machine, thus shared memory (TCP would only add words about
  # unreachable interfaces, the search for fast networks a second to every start), and its cores
  # have other work too: a rank that waits must give way.
  if [[ $kind == userland || -z ${SLURM_JOB_ID:-}${PBS_JOBID:-}${LSB_JOBID:-} ]]; then
    default OMPI_MCA_btl ^tcp,ofi,uct
    default OMPI_MCA_mpi_yield_when_idle 1
  fi
  # Open MPI does not start without these two, and says so in forty lines or not at all.
  [[ -n ${HOME:-} ]] || export HOME="$(getent passwd "$EUID" | cut -d: -f6)"
  if [[ -n ${TMPDIR:-} && ! -d $TMPDIR ]]; then
    printf 'castfem: warning: TMPDIR=%s is no folder: /tmp is used\n' "$TMPDIR" >&2
    unset TMPDIR
  fi
  if [[ $EUID -eq 0 ]]; then
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
  fi
}

# Leaves out of stderr what a launcher adds when a rank has ended with an exit status: castfem has
# said why. No option of Open MPI does it that keeps the status. What a rank that was killed, or
# aborted, makes it say stays. (PMIX_ERR_UNREACH: it has told the end to a rank that was gone.)
without_status() {
  trap '' INT TERM # Ctrl-C goes to all in the terminal; what is left to say is passed on
  exec sed -u -e '/PMIX ERROR: PMIX_ERR_UNREACH in file/d' -e '/^-\{60,\}$/{
    N
    /exited with non-zero status\|terminated normally, but/!{ P; D }
    :block
    /\n-\{60,\}$/d
    N
    b block
  }'
}

# Runs "$@" with the Python that has DOLFINx already; nothing to enter.
run_on_host() {
  local folder=${python%/*}
  case ":$PATH:" in
    *":$folder:"*) ;;
    *) PATH=$folder:$PATH ;; # conda's mpirun and compiler live beside its Python
  esac
  export PATH=$home/venv/bin:$PATH
  run_here "$@"
}

# Variables that would lead the userland's programs back to the host's libraries or interpreters.
forget_host() {
  unset PYTHONPATH PYTHONHOME PYTHONSTARTUP VIRTUAL_ENV CONDA_PREFIX LD_LIBRARY_PATH LD_PRELOAD \
    PETSC_DIR PETSC_ARCH SLEPC_DIR OPAL_PREFIX CC CXX
  export PYTHONNOUSERSITE=1 LC_ALL=C.UTF-8 CASTFEM_INSIDE=$userland
  export PRTE_MCA_plm=^slurm PRTE_MCA_ras=^slurm # a batch system's launcher is not inside
  export PATH=${home:+$home/venv/bin:}/usr/bin:/bin:/usr/sbin:/sbin
}

# Fills `binds` with what bubblewrap shows inside.
collect_binds() {
  local entry path
  binds=(--dev-bind /dev /dev --proc /proc --ro-bind /sys /sys --ro-bind "$userland/etc" /etc)
  for entry in "$userland"/*; do
    [[ -L $entry ]] && binds+=(--symlink "$(readlink "$entry")" "/${entry##*/}")
  done
  for entry in "$userland"/usr/*; do
    path=/usr/${entry##*/}
    [[ $path == /usr/local || $path == /usr/src ]] || binds+=(--ro-bind "$entry" "$path")
  done
  for entry in /*; do # every top-level folder of the host that the userland does not own
    case $entry in
      /usr | /etc | /boot | /dev | /proc | /sys | /lost+found) continue ;;
    esac
    [[ -L $userland$entry ]] && continue
    if [[ -L $entry ]]; then
      binds+=(--symlink "$(readlink "$entry")" "$entry")
    elif [[ -d $entry ]]; then
      binds+=(--bind "$entry" "$entry")
    fi
  done
  for entry in /usr/local /usr/src; do # the user's own part of /usr, but for its Python packages
    [[ -d $entry ]] && binds+=(--bind "$entry" "$entry")
  done
  [[ -d /usr/local/lib ]] && binds+=(--tmpfs /usr/local/lib --remount-ro /usr/local/lib)
  for path in passwd group hosts hostname resolv.conf localtime pip.conf; do
    [[ -f /etc/$path ]] && binds+=(--ro-bind "/etc/$path" "/etc/$path")
  done
  path=${PIP_CERT:-/etc/ssl/certs/ca-certificates.crt}
  [[ -f $path ]] && binds+=(--ro-bind "$path" /etc/ssl/certs/ca-certificates.crt)
  binds+=(--remount-ro /) # a new top-level folder would be lost at the end: refuse it
}

# Passes signal $1 on to the program, once. It has a session of its own, so that a Ctrl-C reaches
# it through here only; $2 is "group" for what a terminal would send to the whole group.
#
# Open MPI's mpirun kills its ranks a quarter of a second after a signal that stops it, that of MPICH
# at once on a hang-up: too soon for castfem to save a step. Each hands SIGUSR1 to its ranks. So they
# get that one first, which stops castfem as the others do; a second signal is for mpirun itself.
forward() {
  local number=$1 whom=$2 pid=$child children=/proc/$child/task/$child/children
  signalled=yes
  [[ -n $child ]] || { early=("$@") && return 0; }
  if [[ -n $launcher && $number =~ ^(INT|TERM|HUP)$ ]]; then
    [[ -z $asked || $((SECONDS - asked)) -ge 2 ]] || return 0 # `timeout` sends each signal twice
    [[ -n $asked ]] || number=USR1 whom=one
    asked=$SECONDS
  fi
  # bubblewrap's one child. Read without another process: what sends a signal twice, to this shell
  # and then to its group, as `timeout` does, would end that one.
  if [[ $kind == host || $inside == "$userland" ]]; then
    :
  elif [[ -r $children ]]; then
    read -r pid _ <"$children"
  else
    read -r pid _ <<<"$(trap '' INT TERM HUP; ps -o pid= --ppid "$child")"
  fi
  [[ -n $pid ]] || return 0
  if [[ $whom == group ]]; then kill -s "$number" -- "-$pid"; else kill -s "$number" "$pid"; fi \
    2>/dev/null
}

# Passes on to the program, $child, what signals come: from before it starts, or one would end this
# shell and leave the program behind.
catch_signals() {
  trap 'forward INT group' INT
  trap 'forward QUIT group' QUIT
  trap 'forward WINCH group' WINCH
  trap 'forward TERM one' TERM
  trap 'forward HUP one' HUP
  trap 'forward USR1 one' USR1
  trap 'forward USR2 one' USR2
  # No trap for CONT: bash loses a TERM that comes right before it, as `timeout` sends them.
  trap 'forward STOP group; kill -s STOP $$; forward CONT group' TSTP
}

# Waits for the program in the background, $child.
wait_for_child() {
  local signalled=first status=0
  [[ -z ${early[*]} ]] || forward "${early[@]}"
  while [[ -n $signalled ]]; do # a trap cuts `wait` short: the program may still be at work
    signalled=
    wait "$child"
    status=$?
  done
  exit "$status"
}

# Runs a program that needs no userland, or is in it already.
run_here() {
  local child='' asked='' early=()
  [[ -n $launcher ]] || exec "$@"
  catch_signals
  (
    trap - INT QUIT # ignored in the background
    exec setsid "$@"
  ) <&0 &
  child=$!
  wait_for_child
}

# bubblewrap would die of a signal and leave the program behind: it ignores them, this shell
# forwards them, and `env --default-signal` gives the program its ordinary ones back.
run_in_userland() {
  local binds child='' asked='' early=()
  [[ -n $bwrap ]] || die "bubblewrap is missing; run \`make env\` in the checkout again"
  [[ -e $userland/castfem-ready || -z $home ]] ||
    die "the userland $userland is gone; run \`make env\` in the checkout again"
  collect_binds
  [[ $PWD/ != /etc/* && $PWD/ != /boot/* ]] ||
    die "$PWD is not visible in the userland; run it from another folder"
  catch_signals
  (
    trap '' HUP INT QUIT TERM USR1 USR2
    exec "$bwrap" --die-with-parent --new-session "${binds[@]}" --chdir "$PWD" \
      env --default-signal=HUP,INT,QUIT,TERM,USR1,USR2 -- "$@"
  ) <&0 &
  child=$!
  wait_for_child
}

home='' userland='' kind=userland python='' openmpi='' launcher='' inside=''
if [[ ${1:-} == --userland ]]; then
  userland=${2:?}
  shift 2
else
  home=${1:?}
  shift
  # shellcheck source=/dev/null
  . "$home/env.conf" || die "no environment in $home; run \`make env\` in the checkout"
fi
[[ $# -gt 0 ]] || die "nothing to run"

set_defaults
[[ $1 == mpirun ]] && exec 2> >(without_status >&2) && launcher=yes
[[ $kind == userland ]] || run_on_host "$@"
inside=${CASTFEM_INSIDE:-}
bwrap=$(command -v bwrap)
forget_host
[[ $inside == "$userland" ]] && run_here "$@" # already there, as under mpirun
run_in_userland "$@"
