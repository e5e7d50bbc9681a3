# Behind a TLS proxy or with POGON_TLS_CERT and POGON_TLS_KEY: it refuses to listen in the open without either.
FROM python:3.11-slim AS build
WORKDIR /src
COPY requirements/ requirements/
# What only building needs (node, uv, hatchling) is in an environment of its own, which stays in this stage.
RUN python -m venv /opt/build \
 && /opt/build/bin/pip install --no-cache-dir --require-hashes --only-binary :all: -r requirements/bootstrap.lock \
 && /opt/build/bin/uv pip install --no-cache --python /opt/build/bin/python --require-hashes --only-binary :all: -r requirements/run.lock
COPY . .
# Byte code and templates are compiled here: the image is read-only, and every start would do it anew.
RUN python -m venv --without-pip /opt/pogon \
 && PATH=/opt/build/bin:$PATH uv build --wheel --no-build-isolation --python /opt/build/bin/python --out-dir /dist . \
 && /opt/build/bin/uv pip install --no-cache --compile-bytecode --python /opt/pogon/bin/python --require-hashes --only-binary :all: -r requirements/app.lock \
 && /opt/build/bin/uv pip install --no-cache --compile-bytecode --python /opt/pogon/bin/python --no-deps /dist/*.whl \
 && /opt/pogon/bin/python -m app.web.compile_templates

FROM python:3.11-slim
# The numbers are those of the files in the volume: with the next free one of the base image another base would give another group.
RUN groupadd --gid 10001 pogon \
 && useradd --uid 10001 --gid pogon --no-log-init --no-create-home --home-dir /data --shell /usr/sbin/nologin pogon \
 && install -d -o pogon -g pogon -m 0700 /data
COPY --from=build /opt/pogon /opt/pogon
ENV PATH=/opt/pogon/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    POGON_DATA=/data \
    POGON_HOST=0.0.0.0 \
    POGON_PORT=8000
USER pogon
WORKDIR /data
VOLUME /data
EXPOSE 8000
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=5s --start-period=20s --retries=3 \
    CMD ["python", "-c", "import os, ssl, urllib.request as u; s = 'https' if os.environ.get('POGON_TLS_CERT') else 'http'; u.urlopen(f\"{s}://127.0.0.1:{os.environ['POGON_PORT']}/healthz\", timeout=4, context=ssl._create_unverified_context())"]
CMD ["pogon", "run"]
