#!/bin/sh
# Starts ArduPilot's simulator (SITL) from an ArduPilot that is there already. It sends MAVLink to UDP port 14540, and is
# ready to arm some 40 s later.
set -eu
usage="usage: start.sh DIRECTORY (an ArduPilot source tree in which './waf copter' was built for sitl)"
tree=$(cd "${1:?$usage}" && pwd)
here=$(cd "$(dirname "$0")" && pwd)
program=$tree/build/sitl/bin/arducopter
defaults=$tree/Tools/autotest/default_params/copter.parm
for file in "$program" "$defaults"; do
    [ -e "$file" ] || { echo "$file is not there; $usage" >&2; exit 1; }
done

# A directory of its own, so that parameters of earlier runs play no part.
cd "$(mktemp -d)"
exec "$program" --model + --wipe --speedup 1 --home 47.3977,8.5456,488,0 \
    --defaults "$defaults,$here/quadctl.parm" --serial0 udpclient:127.0.0.1:14540
