"""Files that come in and go out: uploads and their import, downloads, small pictures."""
