# The testbed with everything but drivers of real robots, and Ray for campaigns.
#   docker build -t bns-testbed .
#   docker run --rm -v "$PWD/runs:/runs" bns-testbed bns run demo --out /runs/demo
FROM python:3.12-slim-bookworm
COPY docker/install.sh constraints.txt /opt/bns/
RUN sh /opt/bns/install.sh system
COPY pyproject.toml README.md LICENSE /opt/bns/
COPY bns /opt/bns/bns
COPY models /opt/bns/models
COPY worlds /opt/bns/worlds
COPY gap /opt/bns/gap
COPY viz /opt/bns/viz
COPY hardware /opt/bns/hardware
COPY examples /opt/bns/examples
RUN sh /opt/bns/install.sh package /opt/bns
COPY docker/node.sh /opt/bns/
RUN useradd --create-home bns && mkdir /runs && chown bns /runs
USER bns
WORKDIR /runs
ENV OMP_NUM_THREADS=1 RERUN_ANALYTICS=0
CMD ["bns", "doctor"]
