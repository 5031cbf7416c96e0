"""Global search: networks chosen among candidate poses whose information is computed once."""
