# vico on Debian, for one machine, Slurm (Apptainer) and KubeRay: docs/many_machines.md.
#
#     docker build -t vico .
#     docker run --rm -v "$PWD:/data" vico world build --lat 60.1690 --lon 24.9435 --out helsinki
FROM debian:bookworm-slim

# Of pyproject.toml. "worldgen" builds worlds, "ray" and "s3" are for many machines.
ARG EXTRAS=worldgen,ray,s3

# libatomic is for SUMO's netconvert, wget is what KubeRay asks a node with whether it is well.
RUN apt-get update \
 && apt-get install --yes --no-install-recommends ca-certificates libatomic1 python3 python3-venv wget \
 && rm -rf /var/lib/apt/lists/*

ENV PATH=/opt/vico/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    RAY_USAGE_STATS_ENABLED=0 \
    VICO_CACHE=/var/cache/vico

RUN python3 -m venv /opt/vico

# What is installed changes rarely, the sources often.
WORKDIR /opt/vico/build
COPY constraints.txt pyproject.toml README.md LICENSE NOTICE ./
COPY src ./src
RUN pip install --no-cache-dir --disable-pip-version-check -c constraints.txt ".[$EXTRAS]" \
 && rm -rf /opt/vico/build/*

# Nothing runs as root. Whoever it is has a home and may write the cache: Ray and compiled code want both.
RUN useradd --create-home --uid 1000 vico \
 && mkdir -p /var/cache/vico /data \
 && chown vico /var/cache/vico /data
USER vico
RUN vico warm-up

WORKDIR /data
ENTRYPOINT ["vico"]
CMD ["--help"]
