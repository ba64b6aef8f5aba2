"""A cell and its maps in three dimensions, in the browser (extra ``[view]``)."""
