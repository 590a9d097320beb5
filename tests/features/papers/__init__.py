"""One test for each number of the five papers: literals beside what robots, jobs and runs give."""
