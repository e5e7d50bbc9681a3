"""`python -m app.web.compile_templates` compiles every template, as an installation does whose server may not write into it."""

from app.web import view


def main() -> None:
    """Compile what is not yet; what is and may be taken costs a look."""
    environment = view.templates()
    for name in environment.list_templates(extensions=["html"]):
        environment.get_template(name)


if __name__ == "__main__":
    main()
