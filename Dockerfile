# docker build -t reachmap .                    everything
# docker build -t reachmap --build-arg PARTS=ranking .   ranking with finished maps
# docker run --rm -v "$PWD:/work" --user "$(id -u):$(id -g)" reachmap rank grasps.json
ARG PYTHON=3.12

FROM python:${PYTHON}-slim AS build
ARG PARTS=all
WORKDIR /source
COPY . .
RUN python -m venv /opt/reachmap \
    && if [ "$PARTS" = ranking ]; then \
         /opt/reachmap/bin/pip install --no-cache-dir -r requirements-ranking.txt \
         && /opt/reachmap/bin/pip install --no-cache-dir --no-deps .; \
       else \
         /opt/reachmap/bin/pip install --no-cache-dir .; \
       fi

FROM python:${PYTHON}-slim
COPY --from=build /opt/reachmap /opt/reachmap
ENV PATH=/opt/reachmap/bin:$PATH
RUN useradd --create-home reachmap
USER reachmap
WORKDIR /work
ENTRYPOINT ["reachmap"]
CMD ["--help"]
