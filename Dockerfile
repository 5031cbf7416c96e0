# The tag names a release of Python and of Debian, so that a build today is the build of tomorrow.
FROM python:3.11.13-slim-bookworm AS build
WORKDIR /src
COPY . .
RUN pip install --no-cache-dir build -c constraints.txt \
    && python -m build --wheel --outdir /wheels && cp constraints.txt /wheels

FROM python:3.11.13-slim-bookworm
COPY --from=build /wheels /wheels
# The versions that the tests ran with.
RUN pip install --no-cache-dir -c /wheels/constraints.txt /wheels/*.whl && rm -r /wheels \
    && useradd --create-home --uid 10001 --groups dialout,video rigwright \
    && install -d -o rigwright -g rigwright /data /station
USER rigwright
ENV RIGWRIGHT_HOST=0.0.0.0 RIGWRIGHT_PORT=8000 RIGWRIGHT_DATA_DIR=/data
VOLUME /data
EXPOSE 8000
# The service answers at once even while jobs run, so a slow answer is a fault. The page itself
# needs no key.
HEALTHCHECK --interval=30s --timeout=5s --start-period=20s CMD \
    ["python", "-c", "from urllib.request import urlopen; urlopen('http://127.0.0.1:8000/', timeout=4)"]
STOPSIGNAL SIGTERM
CMD ["rigwright", "serve"]
