#!/bin/sh
# Flies a staircase on the real autopilots that are there: PX4=DIRECTORY, ARDUPILOT=DIRECTORY (see px4/start.sh and
# ardupilot/start.sh), or LINK=URL for one that runs already, in a container for example, with CONFIG=FILE for its vehicle.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
quadctl=${QUADCTL:-quadctl}
logs=${LOGS:-logs}
failed=

fly() { # NAME LINK CONFIG
    echo "== $1"
    "$quadctl" fly "$here/staircase.yaml" --link "$2" --config "$3" --set-params --log-dir "$logs" || failed="$failed $1"
}

fly_started() { # NAME DIRECTORY
    "$here/$1/start.sh" "$2" >"$logs/$1.txt" 2>&1 &
    autopilot=$!
    trap 'kill $autopilot 2>/dev/null || true' EXIT INT TERM
    sleep "${BOOT_S:-20}" # an estimator wants time after boot before it trusts itself
    fly "$1" udpin://127.0.0.1:14540 "$here/$1/flight.yaml"
    kill $autopilot 2>/dev/null || echo "$1 ended by itself; what it printed is in $logs/$1.txt"
    wait $autopilot 2>/dev/null || true
    trap - EXIT INT TERM
}

if [ -z "${PX4:-}${ARDUPILOT:-}${LINK:-}" ]; then
    echo "no autopilot to check: say PX4=DIRECTORY, ARDUPILOT=DIRECTORY or LINK=URL (sitl/px4 and sitl/ardupilot tell how)" >&2
    exit 1
fi
mkdir -p "$logs"
[ -z "${PX4:-}" ] || fly_started px4 "$PX4"
[ -z "${ARDUPILOT:-}" ] || fly_started ardupilot "$ARDUPILOT"
[ -z "${LINK:-}" ] || fly link "$LINK" "${CONFIG:-$here/px4/flight.yaml}"
[ -z "$failed" ] || { echo "not flown:$failed" >&2; exit 1; }
