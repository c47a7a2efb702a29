#!/bin/sh
# Starts ArduPilot's simulator (SITL) from an ArduPilot that is there already. It sends MAVLink to UDP port 14540, and is
# ready to arm some 40 s later.
set -eu
usage="usage: start.sh DIRECTORY [quad|hexa] (an ArduPilot source tree in which './waf copter' was built for sitl)"
tree=$(cd "${1:?$usage}" && pwd)
frame=${2:-quad}
here=$(cd "$(dirname "$0")" && pwd)
program=$tree/build/sitl/bin/arducopter
defaults=$tree/Tools/autotest/default_params/copter.parm
for file in "$program" "$defaults"; do
    [ -e "$file" ] || { echo "$file is not there; $usage" >&2; exit 1; }
done
case $frame in
    quad) model=+ frame_defaults= ;;
    hexa) model=hexa frame_defaults=,$here/hexa.parm ;;
    *) echo "frame $frame is not known; $usage" >&2 && exit 1 ;;
esac

# A directory of its own, so that parameters of earlier runs play no part.
cd "$(mktemp -d)"
exec "$program" --model $model --wipe --speedup 1 --home 47.3977,8.5456,488,0 \
    --defaults "$defaults,$here/quadctl.parm$frame_defaults" --serial0 udpclient:127.0.0.1:14540
