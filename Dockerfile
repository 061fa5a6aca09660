# The one list of what formingx needs. `fx` reads SUITE and PACKAGES from here too.
ARG SUITE=trixie
FROM debian:${SUITE}-slim
ARG PACKAGES="\
    ffmpeg \
    furo \
    python3-dolfinx \
    python3-ezdxf \
    python3-gmsh \
    python3-ipykernel \
    python3-matplotlib \
    python3-myst-parser \
    python3-nbconvert \
    python3-openpyxl \
    python3-pip \
    python3-plotly \
    python3-pytest \
    python3-pytest-xdist \
    python3-pyvista \
    python3-scipy \
    python3-sphinx \
    python3-tqdm \
    python3-venv \
    libopenblas0-pthread \
    xauth \
    xvfb"
RUN apt-get update \
 && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $PACKAGES \
 && rm -rf /var/lib/apt/lists/*
# open-mpi/ompi#13918: with its other topology component Open MPI hangs now and then
ENV FX_INSIDE=1 OMPI_MCA_topo=basic
