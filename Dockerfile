# The program for clusters and other machines: docker build --tag tessuto .
#
#   docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/work" tessuto check scenes/curtain
#   apptainer build tessuto.sif docker-daemon://tessuto:latest        # one file, for clusters; signals and exit statuses pass through it
#
# Needs a processor with AVX2, like every build for x86-64 with .cargo/config.toml. This file has not been built yet: no container engine was at
# hand where it was written; its commands are those of tools/release.sh, which has been run.
FROM rust:1.95-bookworm AS build
WORKDIR /tessuto
COPY . .
RUN cargo build --release --locked -p tessuto-cli \
    && strip -o /usr/local/bin/tessuto target/release/tessuto \
    && python3 tools/licences.py --target "$(rustc -vV | sed -n 's/^host: //p')" > /LICENSES.txt

FROM debian:bookworm-slim
# `tessuto import` reads videos with it.
RUN apt-get update && apt-get install --yes --no-install-recommends ffmpeg && rm -rf /var/lib/apt/lists/*
COPY --from=build /usr/local/bin/tessuto /usr/local/bin/tessuto
COPY --from=build /LICENSES.txt /tessuto/LICENSE-MIT /tessuto/LICENSE-APACHE /usr/share/doc/tessuto/
WORKDIR /work
ENTRYPOINT ["tessuto"]
