#!/bin/sh
# Starts PX4's own simulator (SIH, no other program needed) from a PX4 that is there already.
# It sends MAVLink to UDP port 14540.
set -eu
usage="usage: start.sh DIRECTORY (a PX4 build, such as PX4-Autopilot/build/px4_sitl_default: it holds bin/px4 and etc)"
build=$(cd "${1:?$usage}" && pwd)
[ -x "$build/bin/px4" ] || { echo "$build/bin/px4 is not there; $usage" >&2; exit 1; }

while read -r name value; do
    case $name in '' | '#'*) ;; *) export "PX4_PARAM_$name=$value" ;; esac
done <"$(dirname "$0")/parameters.txt"

# A directory of its own, so that parameters of earlier runs play no part.
work=$(mktemp -d)
export PX4_SIM_MODEL=sihsim_quadx
exec "$build/bin/px4" -d -w "$work" "$build/etc"
