# castfem on Debian 13:
#   docker build -t castfem .
#   docker run --rm -v "$PWD:/data" castfem run my_case.toml
FROM debian:trixie

# The one package list, shared with the private userland (tools/env.sh).
COPY tools/packages.txt /tmp/packages.txt
RUN apt-get update \
    && sed 's/#.*//' /tmp/packages.txt \
       | DEBIAN_FRONTEND=noninteractive xargs apt-get install -y --no-install-recommends \
    && rm -rf /var/lib/apt/lists/* /tmp/packages.txt

COPY pyproject.toml README.md /src/
COPY castfem /src/castfem
COPY forms /src/forms
COPY meshes /src/meshes
COPY cases /src/cases
RUN python3 -m venv --system-site-packages --without-pip /opt/castfem \
    && /opt/castfem/bin/python -m pip install --no-build-isolation --no-deps --no-index /src \
    && rm -rf /src

# What tools/enter.sh sets too: one thread a rank, any number of ranks, shared memory between them,
# waiting ranks give way.
ENV PATH=/opt/castfem/bin:$PATH \
    LC_ALL=C.UTF-8 \
    OMP_NUM_THREADS=1 \
    OMPI_ALLOW_RUN_AS_ROOT=1 \
    OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 \
    OMPI_MCA_btl=^tcp,ofi,uct \
    OMPI_MCA_mpi_yield_when_idle=1 \
    PRTE_MCA_rmaps_default_mapping_policy=:oversubscribe
WORKDIR /data
ENTRYPOINT ["castfem"]
