"""Documents made from the code: schemas, key tables, the OpenAPI document."""
