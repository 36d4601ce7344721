"""Jobs that take minutes and outlive the server: renders, comparisons, BTF compression."""
