# The command line and the bench, without a compiler in the final image and without root.
#   docker build -t virtual-wind-tunnel .
#   docker run --rm -v "$PWD:/data" virtual-wind-tunnel diagnose campaign
#   docker run --rm --network host -v "$PWD:/data" virtual-wind-tunnel bench --no-browser
FROM python:3.13-slim AS build
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
COPY . /source
RUN python -m venv /opt/tunnel && /opt/tunnel/bin/pip install --no-cache-dir '/source[import,frames,bench]'

FROM python:3.13-slim
COPY --from=build /opt/tunnel /opt/tunnel
RUN useradd --create-home rig && mkdir /data && chown rig /data
USER rig
WORKDIR /data
ENTRYPOINT ["/opt/tunnel/bin/tunnel"]
CMD ["--help"]
