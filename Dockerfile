# The program (`docker build -t dipac .`), and what one develops it in (target `development`, .devcontainer/). Nobody is
# root in either. Everything that is not Python comes from Debian, everything else from the lock.
FROM debian:trixie-slim AS system
RUN apt-get update \
    && apt-get install --yes --no-install-recommends ca-certificates git libegl1 libgl1 libx11-6 make python3 python3-venv \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --shell /bin/bash dipac \
    && install --directory --owner dipac --group dipac /dipac /dipac/recordings
WORKDIR /dipac
EXPOSE 8088

# The checkout is mounted by who starts it; `make develop` fills its .venv.
FROM system AS development
RUN apt-get update \
    && apt-get install --yes --no-install-recommends chromium \
    && rm -rf /var/lib/apt/lists/*
USER dipac

# Dependencies come before the program, so that a change of it does not download them again; what installs it wants to
# find a package.
FROM system AS program
USER dipac
ENV PATH=/dipac/.venv/bin:$PATH
COPY --chown=dipac:dipac Makefile pyproject.toml requirements.lock README.md LICENSE ./
COPY --chown=dipac:dipac app/__init__.py app/
RUN make setup && rm -rf "$HOME/.cache"
COPY --chown=dipac:dipac app app
ENTRYPOINT ["dipac"]
CMD ["run", "rope_push"]
