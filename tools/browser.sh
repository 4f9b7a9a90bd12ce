#!/usr/bin/env bash
# Looks at castfem's HTML pages in a real browser: starts Chromium without a window and runs the tests
# of tests/browser inside the environment HOME, which reach it through its debugging port.
#
#   tools/browser.sh HOME [PYTEST ARGUMENT ...]
#   tools/browser.sh HOME SCRIPT.py [ARGUMENT ...]     runs a script instead of the tests
#
# $CHROMIUM names the browser; otherwise one of the usual names, from Debian as root if there is none.

set -u
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 1
home=$PWD/$1
shift

die() {
  printf 'castfem: error: %s\n' "$*" >&2
  exit 1
}

# The first browser there is.
browser() {
  local name
  for name in "${CHROMIUM:-}" chromium chromium-browser google-chrome; do
    command -v "${name:-/nowhere}" && return
  done
  return 1
}

if ! program=$(browser); then
  [[ -z ${CHROMIUM:-} && $EUID -eq 0 ]] && command -v apt-get >/dev/null ||
    die "no Chromium: install Debian's package chromium, or set CHROMIUM to a browser of its kind"
  printf 'castfem: installing chromium\n' >&2
  { apt-get update -qq && apt-get install -qq --no-install-recommends chromium; } >/dev/null 2>&1 ||
    die "cannot install chromium; install it by hand, then run it again"
  program=$(browser) || die "chromium was installed and is not found"
fi

profile=$(mktemp -d)
options=(--headless --disable-gpu --no-first-run --remote-debugging-port=0)
[[ $EUID -ne 0 ]] || options+=(--no-sandbox) # which root cannot have
"$program" "${options[@]}" --user-data-dir="$profile" about:blank >"$profile/log" 2>&1 &
running=$!
trap 'kill "$running" 2>/dev/null; wait "$running" 2>/dev/null; rm -rf "$profile"' EXIT
for _ in {1..300}; do
  [[ -s $profile/DevToolsActivePort ]] && break
  kill -0 "$running" 2>/dev/null || die "$program does not start: $(tail -n 1 "$profile/log")"
  sleep 0.1
done
[[ -s $profile/DevToolsActivePort ]] || die "$program has not opened its debugging port in 30 s"
port=$(head -n 1 "$profile/DevToolsActivePort")
"$program" --version 2>/dev/null
what=(-m pytest -n 0 tests/browser)
[[ ${1:-} != *.py ]] || what=()
CASTFEM_BROWSER=$port tools/enter.sh "$home" python "${what[@]}" "$@"
