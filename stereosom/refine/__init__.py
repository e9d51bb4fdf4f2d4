"""One tube, fitted to the outlines in both views: edges, outlines, passes, ends, certainty."""
