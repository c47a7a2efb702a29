# The companion computer: the lean flight install, without the lab. The base image exists for amd64 and arm64.
#   docker build -t quadctl .
#   docker run --rm -it --device /dev/ttyAMA0 --cap-add SYS_NICE -v "$PWD/logs:/flight/logs" \
#       quadctl fly missions/short_hop.yaml --link serial:///dev/ttyAMA0:921600
FROM python:3.12-slim-bookworm

WORKDIR /flight
COPY pyproject.toml constraints.txt README.md LICENSE /src/
COPY quadctl /src/quadctl
# quadctl links to these and packs them.
COPY sitl /src/sitl
COPY config /src/config
COPY missions /src/missions
RUN pip install --no-cache-dir --constraint /src/constraints.txt /src && rm -rf /src

RUN quadctl init /flight

# Not root; dialout may open serial devices.
RUN useradd --create-home --groups dialout pilot && mkdir logs && chown pilot logs
USER pilot

ENTRYPOINT ["quadctl"]
CMD ["--help"]
