"""What `import harness` offers to scripts and notebooks, as functions of names, paths and datasets."""
