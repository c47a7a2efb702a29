#!/bin/sh
# Flies the real autopilots that are there, and prints a table: PX4=DIRECTORY, ARDUPILOT=DIRECTORY (see px4/start.sh and
# ardupilot/start.sh; FRAME=hexa for a hexarotor), or LINK=URL for one that runs already, in a container for example, with
# CONFIG=FILE for its vehicle. Each flies a staircase and a box; then a hover, in which a second program must be refused
# and Ctrl-C must land.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
quadctl=${QUADCTL:-quadctl}
logs=${LOGS:-logs}
frame=${FRAME:-quad}
failed=
autopilot=

row() { # AUTOPILOT FLIGHT RESULT SENTENCE
    printf '%-10s %-10s %-7s %s\n' "$1" "$2" "$3" "$4" >>"$logs/table.txt"
    [ "$3" = ok ] || failed="$failed $1:$2"
}

said() { # FILE WORDS: the first line that holds the words, else the last one
    grep -m 1 -e "$2" "$1" || tail -n 1 "$1"
}

fly() { # AUTOPILOT MISSION LINK CONFIG: in the folder of the logs that is named after them, with what it prints
    mkdir -p "$logs/$1_$2"
    exec "$quadctl" fly "$here/$2.yaml" --link "$3" --config "$4" --set-params --log-dir "$logs/$1_$2"
}

completed() { # AUTOPILOT MISSION LINK CONFIG
    out=$logs/$1_$2.txt
    echo "== $1: $2"
    result=ok
    (fly "$@") >"$out" 2>&1 || result=FAILED
    row "$1" "$2" $result "$(said "$out" 'tracking error')"
}

interrupted() { # AUTOPILOT LINK CONFIG
    out=$logs/$1_ctrl_c.txt
    echo "== $1: a second program, and Ctrl-C in flight"
    rm -f "$logs/$1_box/"*.csv
    (fly "$1" box "$2" "$3") >"$out" 2>&1 &
    flight=$!
    seconds=0
    until grep -q ',north$' "$logs/$1_box/"*.csv 2>/dev/null; do
        seconds=$((seconds + 1))
        if [ $seconds -gt 150 ] || ! kill -0 $flight 2>/dev/null; then break; fi
        sleep 1
    done
    case $2 in
        udpin:*)
            second=$logs/$1_second.txt
            result=FAILED
            (fly "$1" box "$2" "$3") >"$second" 2>&1 || ! grep -q 'is held by' "$second" || result=ok
            row "$1" second $result "$(said "$second" 'is held by')"
            ;;
    esac
    kill -INT $flight 2>/dev/null || true
    wait $flight || true
    result=FAILED
    ! grep -q 'asked to land by SIGINT' "$out" || result=ok
    row "$1" ctrl-c $result "$(said "$out" 'asked to land by SIGINT')"
}

flights() { # AUTOPILOT LINK CONFIG
    completed "$1" staircase "$2" "$3"
    completed "$1" box "$2" "$3"
    interrupted "$1" "$2" "$3"
}

started() { # NAME DIRECTORY CONFIG [FRAME]
    "$here/$1/start.sh" "$2" ${4:+"$4"} >"$logs/$1.txt" 2>&1 &
    autopilot=$!
    trap 'kill $autopilot 2>/dev/null || true' EXIT INT TERM
    sleep "${BOOT_S:-20}" # an estimator wants time after boot before it trusts itself
    flights "$1" udpin://127.0.0.1:14540 "$3"
    kill $autopilot 2>/dev/null || echo "$1 ended by itself; what it printed is in $logs/$1.txt"
    wait $autopilot 2>/dev/null || true
    trap - EXIT INT TERM
}

if [ -z "${PX4:-}${ARDUPILOT:-}${LINK:-}" ]; then
    echo "no autopilot to check: say PX4=DIRECTORY, ARDUPILOT=DIRECTORY or LINK=URL (sitl/px4 and sitl/ardupilot tell how)" >&2
    exit 1
fi
case $frame in
    quad) ardupilot_config=$here/ardupilot/flight.yaml ;;
    hexa) ardupilot_config=$here/ardupilot/hexa_flight.yaml ;;
    *) echo "FRAME=$frame: expected quad or hexa" >&2 && exit 1 ;;
esac
mkdir -p "$logs"
: >"$logs/table.txt"
[ -z "${PX4:-}" ] || started px4 "$PX4" "$here/px4/flight.yaml"
[ -z "${ARDUPILOT:-}" ] || started ardupilot "$ARDUPILOT" "$ardupilot_config" "$frame"
[ -z "${LINK:-}" ] || flights link "$LINK" "${CONFIG:-$here/px4/flight.yaml}"
echo
cat "$logs/table.txt"
[ -z "$failed" ] || { echo "not as expected:$failed" >&2; exit 1; }
