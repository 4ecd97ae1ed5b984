"""What each way of simulating the robot costs and how exact it is, in one table."""
