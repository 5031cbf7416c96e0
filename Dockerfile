FROM python:3.11-slim AS build
WORKDIR /src
COPY . .
RUN pip install --no-cache-dir build && python -m build --wheel --outdir /wheels

FROM python:3.11-slim
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir /wheels/*.whl && rm -r /wheels \
    && useradd --create-home --uid 10001 rigwright \
    && install -d -o rigwright -g rigwright /data
USER rigwright
ENV RIGWRIGHT_HOST=0.0.0.0 RIGWRIGHT_PORT=8000 RIGWRIGHT_DATA_DIR=/data
VOLUME /data
EXPOSE 8000
# The service answers at once even while jobs run, so a slow answer is a fault.
HEALTHCHECK --interval=30s --timeout=5s --start-period=20s CMD \
    ["python", "-c", "from urllib.request import urlopen; urlopen('http://127.0.0.1:8000/v1/health', timeout=4)"]
STOPSIGNAL SIGTERM
CMD ["rigwright", "serve"]
