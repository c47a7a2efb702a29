# The companion computer: the lean flight install, without the lab. The base image exists for amd64 and arm64.
#   docker build -t quadctl .
#   docker run --rm -v "$PWD:/flight" quadctl init .        # once; then describe your vehicle in config/
#   docker run --rm -it --device /dev/ttyAMA0 --ulimit rtprio=20 --ulimit memlock=-1 -v "$PWD:/flight" \
#       quadctl fly missions/short_hop.yaml --link serial:///dev/ttyAMA0:921600
# The image holds no vehicle of its own: without config/flight.yaml in that folder it flies none. A capability (--cap-add)
# would not reach a program that does not run as root; limits do.
FROM python:3.12-slim-bookworm

WORKDIR /flight
COPY pyproject.toml constraints.txt README.md LICENSE /src/
COPY quadctl /src/quadctl
# quadctl links to these and packs them.
COPY sitl /src/sitl
COPY config /src/config
COPY missions /src/missions
RUN pip install --no-cache-dir --constraint /src/constraints.txt /src && rm -rf /src

# Not root; dialout may open serial devices.
RUN useradd --create-home --groups dialout pilot && chown pilot /flight
USER pilot

ENTRYPOINT ["quadctl"]
CMD ["--help"]
